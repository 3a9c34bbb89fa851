/* A controller in C: it damps every joint of a running daemon and prints how long a step takes.
 *
 * cc -O2 examples/c_client/client.c -o client -I sim-daemon/client-c/include \
 *     -L target/release -ltightloop_client -Wl,-rpath,$PWD/target/release
 * ./client NAME [STEPS] [HZ]     1000 steps at 1000 Hz without numbers; 0 Hz is as fast as the daemon answers
 */
#define _POSIX_C_SOURCE 200809L
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include "tightloop_client.h"

static void check(tl_status status) {
    if (status == TL_STATUS_OK) return;
    fprintf(stderr, "error %d: %s\n", (int)status, tl_last_error());
    exit(1);
}

static double now_us(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * 1e6 + now.tv_nsec / 1e3;
}

static int by_size(const void *a, const void *b) {
    return (*(const double *)a > *(const double *)b) - (*(const double *)a < *(const double *)b);
}

int main(int argc, char **argv) {
    if (argc < 2) return fprintf(stderr, "usage: %s NAME [STEPS] [HZ]\n", argv[0]), 2;
    long steps = argc > 2 ? atol(argv[2]) : 1000, hz = argc > 3 ? atol(argv[3]) : 1000;
    if (steps < 1 || hz < 0) return fprintf(stderr, "give 1 or more STEPS, and HZ of 0 or more\n"), 2;

    tl_client *client;
    tl_description about;
    tl_frame *frame;
    tl_array qd, q;
    check(tl_attach(TL_API_VERSION, argv[1], NULL, &client));
    check(tl_describe(client, &about));
    size_t count = about.worlds * about.dofs;
    double step_ms = about.dt * about.substeps * 1e3;
    printf("%s: %zu worlds of %zu dofs, %g ms per step\n", about.name, about.worlds, about.dofs, step_ms);
    float *force = calloc(count + 1, sizeof *force);
    double *trips_us = malloc(steps * sizeof *trips_us), start = now_us();
    if (!force || !trips_us) return 1;

    check(tl_reset(client, NULL, 0, NULL, 0, &frame));
    for (long step = 0; step < steps; step++) {
        check(tl_frame_field(frame, "joint_qd", &qd));
        if (qd.dtype != TL_DTYPE_F32) return fprintf(stderr, "start the daemon with --precision f32\n"), 1;
        for (size_t i = 0; i < count; i++) force[i] = -0.1f * ((const float *)qd.data)[i]; /* [N·m s/rad or N s/m] */
        check(tl_frame_drop(frame));
        while (hz > 0 && now_us() < start + step * 1e6 / hz) nanosleep(&(struct timespec){.tv_nsec = 50000}, NULL);
        double sent = now_us();
        check(tl_set_f32(client, "joint_f", force, count));
        check(tl_step(client, &frame));
        trips_us[step] = now_us() - sent;
    }
    check(tl_detach(client)); /* the last frame stays valid */
    check(tl_frame_field(frame, "joint_q", &q));
    printf("joint_q of world 0:");
    for (size_t i = 0; i < q.columns; i++) printf(" %+.4f", ((const float *)q.data)[i]);
    qsort(trips_us, steps, sizeof *trips_us, by_size);
    const double p50 = trips_us[steps / 2], p99 = trips_us[steps * 99 / 100], max = trips_us[steps - 1];
    printf("\nround trip: p50 %.2f us, p99 %.2f us, max %.2f us\n", p50, p99, max);
    free(force), free(trips_us);
    return tl_frame_drop(frame);
}
