/* A controller in C of a daemon that keeps to real time: realtime NAME SECONDS. Prints what benches/daemon/realtime.rs prints. */
#define _POSIX_C_SOURCE 200809L
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include "tightloop_client.h"

enum { PERIOD_NS = 1000000, WARM_UP = 200 };

static void check(tl_status status) {
    if (status == TL_STATUS_OK) return;
    fprintf(stderr, "error %d: %s\n", (int)status, tl_last_error());
    exit(1);
}

static int by_size(const void *a, const void *b) {
    return (*(const double *)a > *(const double *)b) - (*(const double *)a < *(const double *)b);
}

int main(int argc, char **argv) {
    if (argc != 3) return fprintf(stderr, "usage: %s NAME SECONDS\n", argv[0]), 2;
    const long frames = atol(argv[2]) * (1000000000L / PERIOD_NS);
    tl_client *client;
    tl_description about;
    tl_timing timing;
    tl_frame *frame;
    tl_frame_info info = {0};
    tl_array q;
    check(tl_attach(TL_API_VERSION, argv[1], NULL, &client));
    check(tl_describe(client, &about));
    const size_t count = about.worlds * about.dofs;
    float *target = calloc(count + 1, sizeof *target);
    double *late_us = calloc(frames + 1, sizeof *late_us);
    if (frames < 1 || !target || !late_us) return 1;

    check(tl_reset(client, NULL, 0, NULL, 0, &frame));
    check(tl_frame_field(frame, "joint_q", &q));
    memcpy(target, q.data, count * sizeof *target);
    check(tl_frame_drop(frame));
    for (long step = -WARM_UP; step < frames; step++) {
        if (step == 0) check(tl_read_timing(client, 1, &timing));
        check(tl_set_f32(client, "joint_target_q", target, count));
        check(tl_step(client, &frame));
        struct timespec now;
        clock_gettime(CLOCK_MONOTONIC, &now);
        const int64_t late_ns = now.tv_sec * 1000000000LL + now.tv_nsec - (int64_t)info.due_next_ns;
        if (step >= 0) late_us[step] = late_ns > 0 ? late_ns / 1e3 : 0;
        check(tl_frame_describe(frame, &info));
        check(tl_frame_drop(frame));
    }
    check(tl_read_timing(client, 0, &timing));
    check(tl_detach(client));
    qsort(late_us, frames, sizeof *late_us, by_size);
    printf("{\"frames\": %" PRIu64 ", \"missed\": %" PRIu64 ", \"late\": %" PRIu64, timing.frames, timing.missed, timing.late);
    printf(", \"p50\": %.1f, \"p99\": %.1f", late_us[frames / 2], late_us[frames * 99 / 100]);
    printf(", \"p999\": %.1f, \"worst\": %.1f}\n", late_us[frames * 999 / 1000], late_us[frames - 1]);
    free(target), free(late_us);
    return 0;
}
