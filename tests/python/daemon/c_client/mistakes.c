/* Every mistake of a caller is a status with a sentence: mistakes NAME, of a daemon with 3 worlds of 2 dofs. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "tightloop_client.h"

enum { WORLDS = 3, DOFS = 2, COUNT = WORLDS * DOFS };

static int wrong;

/* The status of a call, and words of its sentence. */
#define EXPECT(call, wanted, words) expect(__LINE__, #call, call, wanted, words)

static void expect(int line, const char *call, tl_status status, tl_status wanted, const char *words) {
    const char *said = status == TL_STATUS_OK ? "" : tl_last_error();
    if (status == wanted && strstr(said, words)) return;
    printf("line %d: %s is %d \"%s\", wanted %d \"%s\"\n", line, call, (int)status, said, (int)wanted, words);
    wrong++;
}

#define HOLDS(condition) \
    do { \
        if (!(condition)) printf("line %d: not %s\n", __LINE__, #condition), wrong++; \
    } while (0)

static const float ones[COUNT] = {1, 1, 1, 1, 1, 1};
static tl_client *waiting;

static void on_alarm(int signal) {
    (void)signal;
    tl_interrupt(waiting);
}

static void *elsewhere(void *unused) {
    HOLDS(tl_last_error()[0] == '\0'); /* each thread has its own */
    return unused;
}

static void attaching(const char *name) {
    tl_client *client = (tl_client *)1;
    tl_options options = {.root = "/dev/null/nowhere"};
    EXPECT(tl_attach(TL_API_VERSION, NULL, NULL, &client), TL_STATUS_BAD_ARGUMENT, "name: it is NULL");
    HOLDS(client == NULL);
    EXPECT(tl_attach(TL_API_VERSION, name, NULL, NULL), TL_STATUS_BAD_ARGUMENT, "client: it is NULL");
    EXPECT(tl_attach(TL_API_VERSION + 1, name, NULL, &client), TL_STATUS_API_VERSION, "compile with the header");
    EXPECT(tl_attach(TL_API_VERSION, "\xff", NULL, &client), TL_STATUS_BAD_ARGUMENT, "name: not UTF-8");
    EXPECT(tl_attach(TL_API_VERSION, "a/b", NULL, &client), TL_STATUS_BAD_NAME, "a/b");
    EXPECT(tl_attach(TL_API_VERSION, "nobody", NULL, &client), TL_STATUS_NO_DAEMON, name);
    EXPECT(tl_attach(TL_API_VERSION, name, &options, &client), TL_STATUS_ROOT, "/dev/null/nowhere");
    options = (tl_options){.wait_s = NAN};
    EXPECT(tl_attach(TL_API_VERSION, name, &options, &client), TL_STATUS_BAD_ARGUMENT, "options.wait_s: NaN s");
}

static void inputs(tl_client *client) {
    tl_frame *frame;
    tl_frame_info info;
    tl_timing timing;
    tl_array array;
    double nan[COUNT] = {0, 0, 0, NAN, 0, 0};
    uint8_t mask[WORLDS] = {1, 0, 255};
    uint64_t seeds[2] = {1, 2};
    EXPECT(tl_set_f32(NULL, "joint_f", ones, COUNT), TL_STATUS_BAD_ARGUMENT, "client: it is NULL");
    EXPECT(tl_set_f32(client, NULL, ones, COUNT), TL_STATUS_BAD_ARGUMENT, "input: it is NULL");
    EXPECT(tl_set_f32(client, "joint_f", NULL, COUNT), TL_STATUS_BAD_ARGUMENT, "values: it is NULL");
    EXPECT(tl_set_f32(client, "joint_f", ones, SIZE_MAX), TL_STATUS_BAD_ARGUMENT, "more than memory can have");
    EXPECT(tl_set_f64(client, "joint_f", nan, DOFS), TL_STATUS_SHAPE, "3 worlds x 2 columns = 6 entries, got 2");
    EXPECT(tl_set_f32(client, "joint_g", ones, COUNT), TL_STATUS_UNKNOWN_NAME, "joint_target_q");
    EXPECT(tl_step(client, NULL), TL_STATUS_BAD_ARGUMENT, "frame: it is NULL");
    EXPECT(tl_set_f64(client, "joint_f", nan, COUNT), TL_STATUS_OK, "");
    EXPECT(tl_step(client, &frame), TL_STATUS_REFUSED, "joint_f");
    HOLDS(frame == NULL);
    EXPECT(tl_step(client, &frame), TL_STATUS_OK, ""); /* what was refused is not sent again */
    EXPECT(tl_frame_field(frame, "step", &array), TL_STATUS_OK, "");
    EXPECT(tl_frame_describe(frame, &info), TL_STATUS_OK, "");
    HOLDS(info.number > 0 && info.busy_ns > 0 && info.due_next_ns == 0); /* this daemon keeps no pace */
    EXPECT(tl_frame_describe(frame, NULL), TL_STATUS_BAD_ARGUMENT, "info: it is NULL");
    EXPECT(tl_frame_describe(NULL, &info), TL_STATUS_BAD_ARGUMENT, "frame: it is NULL");
    HOLDS(info.number == 0);
    EXPECT(tl_read_timing(client, 1, &timing), TL_STATUS_OK, "");
    HOLDS(timing.frames == 1 && timing.missed == 0 && timing.busy.p50 > 0);
    EXPECT(tl_read_timing(client, 0, &timing), TL_STATUS_OK, "");
    HOLDS(timing.frames == 0 && timing.busy.p50 == 0);
    EXPECT(tl_read_timing(client, 0, NULL), TL_STATUS_BAD_ARGUMENT, "timing: it is NULL");
    EXPECT(tl_read_timing(NULL, 0, &timing), TL_STATUS_BAD_ARGUMENT, "client: it is NULL");
    HOLDS(array.dtype == TL_DTYPE_U64 && array.rows == WORLDS && ((const uint64_t *)array.data)[0] == 1);
    EXPECT(tl_frame_drop(frame), TL_STATUS_OK, "");
    EXPECT(tl_reset(client, mask, 2, NULL, 0, &frame), TL_STATUS_SHAPE, "mask");
    EXPECT(tl_reset(client, NULL, 0, seeds, 2, &frame), TL_STATUS_SHAPE, "seed");
    EXPECT(tl_write_f32(client, "joint_f", ones, COUNT, NULL, 0, &frame), TL_STATUS_UNKNOWN_NAME, "joint_qd");
    EXPECT(tl_write_f32(client, "joint_q", ones, 1, NULL, 0, &frame), TL_STATUS_SHAPE, "joint_q");
    EXPECT(tl_write_f32(client, "joint_q", ones, COUNT, mask, WORLDS, &frame), TL_STATUS_OK, "");
    EXPECT(tl_frame_field(frame, "joint_q", &array), TL_STATUS_OK, "");
    const float *q = array.data;
    HOLDS(array.columns == DOFS && q[0] == 1 && q[DOFS] != 1 && q[2 * DOFS + 1] == 1);
    EXPECT(tl_frame_drop(frame), TL_STATUS_OK, "");
    EXPECT(tl_recv(client, &frame), TL_STATUS_NOTHING_SENT, "call send first");
    EXPECT(tl_send(client), TL_STATUS_OK, "");
    EXPECT(tl_send(client), TL_STATUS_STEP_IN_FLIGHT, "call recv first");
    EXPECT(tl_recv(client, &frame), TL_STATUS_OK, "");
    EXPECT(tl_frame_drop(frame), TL_STATUS_OK, "");
}

static void frames(tl_client *client, const tl_description *about) {
    tl_frame *held[16];
    tl_array array;
    size_t count = 0;
    HOLDS(about->frames_held < 16);
    for (; count < about->frames_held; count++) EXPECT(tl_step(client, &held[count]), TL_STATUS_OK, "");
    EXPECT(tl_step(client, &held[count]), TL_STATUS_FRAMES_HELD, "frames are held");
    EXPECT(tl_frame_field(held[0], "joint_p", &array), TL_STATUS_UNKNOWN_NAME, "joint_q");
    HOLDS(array.data == NULL && array.rows == 0);
    EXPECT(tl_frame_field(held[0], "joint_q", NULL), TL_STATUS_BAD_ARGUMENT, "array: it is NULL");
    EXPECT(tl_frame_field(NULL, "joint_q", &array), TL_STATUS_BAD_ARGUMENT, "frame: it is NULL");
    for (size_t i = 0; i < count; i++) EXPECT(tl_frame_drop(held[i]), TL_STATUS_OK, "");
    EXPECT(tl_frame_drop(held[0]), TL_STATUS_STALE_HANDLE, "dropped before");
    EXPECT(tl_frame_field(held[0], "joint_q", &array), TL_STATUS_STALE_HANDLE, "dropped before");
    EXPECT(tl_frame_drop(NULL), TL_STATUS_OK, "");
}

/* A daemon that stands does not hold up a program that wants to go on. */
static void interrupted(tl_client *client, pid_t daemon) {
    tl_frame *frame;
    kill(daemon, SIGSTOP);
    waiting = client;
    signal(SIGALRM, on_alarm);
    alarm(1);
    EXPECT(tl_step(client, &frame), TL_STATUS_INTERRUPTED, "interrupted");
    kill(daemon, SIGCONT);
    EXPECT(tl_step(client, &frame), TL_STATUS_OK, "");
    EXPECT(tl_frame_drop(frame), TL_STATUS_OK, "");
}

int main(int argc, char **argv) {
    if (argc != 3) return 2;
    tl_client *client, *second;
    tl_description about;
    tl_frame *frame;
    tl_array array;
    pthread_t thread;
    attaching(argv[1]);
    HOLDS(pthread_create(&thread, NULL, elsewhere, NULL) == 0 && pthread_join(thread, NULL) == 0);
    EXPECT(tl_attach(TL_API_VERSION, argv[1], NULL, &client), TL_STATUS_OK, "");
    EXPECT(tl_describe(client, &about), TL_STATUS_OK, "");
    HOLDS(about.worlds == WORLDS && about.dofs == DOFS && strcmp(about.dof_names[0], "arm/shoulder") == 0);
    HOLDS(strcmp(about.fields[0].name, "joint_q") == 0 && about.fields[0].shape[1] == DOFS);
    HOLDS(about.input_count > 0 && about.inputs[0].shape[0] == WORLDS && about.write_count > 0);
    EXPECT(tl_describe(client, NULL), TL_STATUS_BAD_ARGUMENT, "description: it is NULL");
    inputs(client);
    frames(client, &about);
    EXPECT(tl_attach(TL_API_VERSION, argv[1], NULL, &second), TL_STATUS_OK, "");
    EXPECT(tl_step(second, &frame), TL_STATUS_LEASE_HELD, "is controlled by process");
    EXPECT(tl_detach(second), TL_STATUS_OK, "");
    EXPECT(tl_step(second, &frame), TL_STATUS_STALE_HANDLE, "detached before");
    EXPECT(tl_detach(second), TL_STATUS_STALE_HANDLE, "detached before");
    EXPECT(tl_detach(NULL), TL_STATUS_OK, "");
    tl_interrupt(NULL);
    interrupted(client, atoi(argv[2]));
    /* a frame outlives its client and its daemon */
    EXPECT(tl_reset(client, NULL, 0, NULL, 0, &frame), TL_STATUS_OK, "");
    kill(atoi(argv[2]), SIGKILL);
    tl_frame *lost;
    EXPECT(tl_step(client, &lost), TL_STATUS_DAEMON_LOST, argv[1]);
    EXPECT(tl_detach(client), TL_STATUS_OK, "");
    EXPECT(tl_frame_field(frame, "joint_q", &array), TL_STATUS_OK, "");
    HOLDS(((const float *)array.data)[0] == 0.3f && ((const float *)array.data)[1] == -0.2f);
    EXPECT(tl_frame_drop(frame), TL_STATUS_OK, "");
    printf("%d wrong\n", wrong);
    return wrong != 0;
}
