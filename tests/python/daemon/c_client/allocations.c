/* Counts how often this thread takes memory in a step: allocations NAME, linked with -rdynamic, so that its malloc is all. */
#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include "tightloop_client.h"

enum { STEPS = 200, WARM_UP = 20 };

/* initial-exec: the variable itself takes no memory */
static __thread unsigned long taken __attribute__((tls_model("initial-exec")));
void *__libc_malloc(size_t);
void *__libc_calloc(size_t, size_t);
void *__libc_realloc(void *, size_t);
void *__libc_memalign(size_t, size_t);

void *malloc(size_t bytes) { return taken++, __libc_malloc(bytes); }
void *calloc(size_t count, size_t bytes) { return taken++, __libc_calloc(count, bytes); }
void *realloc(void *old, size_t bytes) { return taken++, __libc_realloc(old, bytes); }
void *aligned_alloc(size_t alignment, size_t bytes) { return taken++, __libc_memalign(alignment, bytes); }
int posix_memalign(void **memory, size_t alignment, size_t bytes) {
    *memory = aligned_alloc(alignment, bytes);
    return *memory ? 0 : ENOMEM;
}

static void check(tl_status status) {
    if (status == TL_STATUS_OK) return;
    fprintf(stderr, "%s\n", tl_last_error());
    exit(1);
}

static int by_size(const void *a, const void *b) {
    return (*(const unsigned long *)a > *(const unsigned long *)b) - (*(const unsigned long *)a < *(const unsigned long *)b);
}

int main(int argc, char **argv) {
    if (argc != 2) return 2;
    static unsigned long counts[STEPS];
    static const double force[2];
    tl_client *client;
    tl_frame *frame;
    tl_array array;
    check(tl_attach(TL_API_VERSION, argv[1], NULL, &client));
    check(tl_reset(client, NULL, 0, NULL, 0, &frame));
    for (int step = -WARM_UP; step < STEPS; step++) {
        unsigned long before = taken;
        check(tl_frame_field(frame, "joint_q", &array));
        check(tl_frame_drop(frame));
        check(tl_set_f64(client, "joint_f", force, 2));
        check(tl_send(client));
        /* the frame is there before it is received: the transport takes memory to sleep */
        nanosleep(&(struct timespec){.tv_nsec = 2000000}, NULL);
        check(tl_recv(client, &frame));
        if (step >= 0) counts[step] = taken - before;
    }
    qsort(counts, STEPS, sizeof *counts, by_size);
    printf("%lu\n", counts[STEPS / 2]);
    check(tl_frame_drop(frame));
    check(tl_detach(client));
    return 0;
}
