/* A step that takes long holds up neither another thread nor a forked child: threads NAME PID, of a daemon of 3 worlds. */
#define _POSIX_C_SOURCE 200809L
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
#include "tightloop_client.h"

enum { COUNT = 3 * 2 };

static tl_client *client;
static const float ones[COUNT] = {1, 1, 1, 1, 1, 1};

static void *step(void *status) {
    tl_frame *frame;
    *(tl_status *)status = tl_step(client, &frame);
    tl_frame_drop(frame);
    return NULL;
}

static int is(const char *call, tl_status status, tl_status wanted) {
    if (status != wanted) printf("%s is %d \"%s\", wanted %d\n", call, (int)status, tl_last_error(), (int)wanted);
    return status == wanted;
}

/* Calls of the child, which has none of the threads of its parent. */
static int forked(void) {
    tl_frame *frame;
    tl_timing timing;
    tl_description description;
    int right = is("child's tl_set_f32", tl_set_f32(client, "joint_f", ones, COUNT), TL_STATUS_FORKED);
    right &= is("child's tl_step", tl_step(client, &frame), TL_STATUS_FORKED);
    right &= is("child's tl_send", tl_send(client), TL_STATUS_FORKED);
    right &= is("child's tl_recv", tl_recv(client, &frame), TL_STATUS_FORKED);
    right &= is("child's tl_read_timing", tl_read_timing(client, 0, &timing), TL_STATUS_FORKED);
    right &= is("child's tl_describe", tl_describe(client, &description), TL_STATUS_OK);
    right &= is("child's tl_detach", tl_detach(client), TL_STATUS_OK);
    return right;
}

int main(int count, char **arguments) {
    if (count != 3 || tl_attach(TL_API_VERSION, arguments[1], NULL, &client)) return 2;
    pid_t daemon = (pid_t)atoi(arguments[2]);
    tl_status stepped = TL_STATUS_OK;
    pthread_t thread;
    step(&stepped); /* takes the lease */
    if (stepped) return 2;
    kill(daemon, SIGSTOP);
    pthread_create(&thread, NULL, step, &stepped);
    nanosleep(&(struct timespec){0, 300000000}, NULL);
    alarm(20); /* a call that hangs ends the program */
    pid_t child = fork();
    if (child == 0) {
        alarm(10);
        int right = forked();
        fflush(stdout);
        _exit(right ? 0 : 1);
    }
    struct timespec before, after;
    clock_gettime(CLOCK_MONOTONIC, &before);
    int right = is("tl_set_f32", tl_set_f32(client, "joint_f", ones, COUNT), TL_STATUS_OK);
    clock_gettime(CLOCK_MONOTONIC, &after);
    int status;
    waitpid(child, &status, 0);
    kill(daemon, SIGCONT);
    pthread_join(thread, NULL);
    right &= is("the step", stepped, TL_STATUS_OK);
    double took = (double)(after.tv_sec - before.tv_sec) + 1e-9 * (double)(after.tv_nsec - before.tv_nsec);
    if (took > 0.5) printf("tl_set_f32 took %.1f s\n", took), right = 0;
    if (!WIFEXITED(status) || WEXITSTATUS(status)) printf("the child ended with %d\n", status), right = 0;
    tl_detach(client);
    return right ? 0 : 1;
}
