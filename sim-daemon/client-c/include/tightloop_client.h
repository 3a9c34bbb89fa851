/* C client of a tightloop daemon: attach, set inputs, step, and read each frame in place.
 *
 * Errors: calls return TL_STATUS_OK, which is 0, or what is wrong. tl_last_error() then has a sentence with culprit and
 *     cure, and every output of the call is NULL or 0. No call ends the process.
 * Arguments: a client comes from tl_attach, a frame from the call that made it. Texts end with NUL and are UTF-8. Arrays
 *     have as many entries as their count says. NULL is TL_STATUS_BAD_ARGUMENT where a comment does not allow it.
 * Threads: any call from any thread. Calls that step wait for each other. Several threads may read one frame.
 *     A signal handler may call tl_interrupt only.
 * Lifetimes: a frame is valid until tl_frame_drop, also after tl_detach and after the end of the daemon. The texts of a
 *     tl_description are valid until tl_detach. Inputs are copied before the call returns.
 * Handles: a client that was detached and a frame that was dropped are TL_STATUS_STALE_HANDLE. Their memory is used for
 *     the next client or frame, and never freed.
 * Memory: after the first steps this library allocates nothing to set inputs, step, and read and drop frames. The
 *     transport below it takes one small block of memory per step and frees it again, as for a client in Rust.
 */

#ifndef TIGHTLOOP_CLIENT_H
#define TIGHTLOOP_CLIENT_H

/* Made by cbindgen from sim-daemon/client-c/src: change that, not this file. */

#include <stddef.h>
#include <stdint.h>

// Version of this header. tl_attach compares it with the library's.
#define TL_API_VERSION 1

// What a call came to. Numbers keep their meaning; later versions may add some.
typedef enum {
    // Done.
    TL_STATUS_OK = 0,
    // An argument is NULL, misaligned, too long or not UTF-8; the sentence names it.
    TL_STATUS_BAD_ARGUMENT = 1,
    // The client was detached before, or the frame dropped.
    TL_STATUS_STALE_HANDLE = 2,
    // Header and library are of different versions.
    TL_STATUS_API_VERSION = 3,
    // A bug of this library. Nothing else is affected.
    TL_STATUS_INTERNAL = 4,
    // The name cannot be one of a daemon.
    TL_STATUS_BAD_NAME = 10,
    // The folder of lock files cannot be used.
    TL_STATUS_ROOT = 11,
    // No daemon of this name runs.
    TL_STATUS_NO_DAEMON = 12,
    // The daemon has groups; attach to one of them.
    TL_STATUS_GROUPED = 13,
    // Daemon and client speak different versions of the protocol.
    TL_STATUS_PROTOCOL_VERSION = 14,
    // Handshake and description of the daemon do not agree.
    TL_STATUS_HANDSHAKE = 15,
    // The daemon has as many clients as it can have.
    TL_STATUS_TOO_MANY_CLIENTS = 16,
    // Something holds the daemon's name and does not run: no daemon, or one that is still starting.
    TL_STATUS_SILENT = 17,
    // No field or input has this name; the sentence lists those that are there.
    TL_STATUS_UNKNOWN_NAME = 20,
    // An array has the wrong number of entries.
    TL_STATUS_SHAPE = 21,
    // The daemon refused the command; no world was touched.
    TL_STATUS_REFUSED = 30,
    // As many frames are held as there are slots; drop one.
    TL_STATUS_FRAMES_HELD = 31,
    // A step was sent and its frame not received; call tl_recv first.
    TL_STATUS_STEP_IN_FLIGHT = 32,
    // tl_recv without tl_send.
    TL_STATUS_NOTHING_SENT = 33,
    // The process forked; attach again in the child.
    TL_STATUS_FORKED = 34,
    // tl_interrupt ended the wait. The command may have been carried out.
    TL_STATUS_INTERRUPTED = 35,
    // The daemon lives and did not answer in time.
    TL_STATUS_TIMEOUT = 36,
    // The daemon ended; its state is lost.
    TL_STATUS_DAEMON_LOST = 40,
    // Another daemon has the name now; attach again.
    TL_STATUS_DAEMON_RESTARTED = 41,
    // Another client controls the worlds.
    TL_STATUS_LEASE_HELD = 42,
    // Another client took control meanwhile.
    TL_STATUS_LEASE_LOST = 43,
    // Another program changed the daemon's shared memory.
    TL_STATUS_DAMAGED = 44,
    // What the daemon sent makes no sense.
    TL_STATUS_MALFORMED = 45,
    // Shared memory or memory is too small.
    TL_STATUS_MEMORY = 50,
    // The process has too many files open.
    TL_STATUS_DESCRIPTORS = 51,
    // The transport failed.
    TL_STATUS_TRANSPORT = 52,
    // Any other error; the sentence says which.
    TL_STATUS_OTHER = 99,
} tl_status;

// Type of the entries of an array.
typedef enum {
    // float
    TL_DTYPE_F32 = 1,
    // double
    TL_DTYPE_F64 = 2,
    // int32_t
    TL_DTYPE_I32 = 3,
    // uint32_t
    TL_DTYPE_U32 = 4,
    // uint64_t
    TL_DTYPE_U64 = 5,
    // uint8_t
    TL_DTYPE_U8 = 6,
} tl_dtype;

// A connection to a daemon.
typedef struct tl_client tl_client;

// The state of all worlds at one instant. It stays as it is until tl_frame_drop.
typedef struct tl_frame tl_frame;

// How to attach. Zero is the default of each.
typedef struct {
    // Folder of the daemon's lock file; NULL: $TIGHTLOOP_ROOT, or the folder that `tightloop serve` uses.
    const char *root;
    // How long to wait for a daemon that does not run yet; one that starts already gets 10 s where it is 0 [s].
    double wait_s;
} tl_options;

// An array that frames carry, or that a client may send.
typedef struct {
    // Name, such as "joint_q".
    const char *name;
    // Unit, such as "rad or m".
    const char *unit;
    // What it is, in one sentence.
    const char *doc;
    // Type of the entries in the daemon. Inputs may be sent as float or double.
    tl_dtype dtype;
    // Axes in use.
    size_t axes;
    // Shape, worlds first, row-major; 1 for axes that are not in use.
    size_t shape[4];
} tl_array_info;

// What a daemon reports of itself. Its pointers are valid until tl_detach.
typedef struct {
    // Name of the daemon.
    const char *name;
    // Where the physics runs, such as "cpu".
    const char *device;
    // Number of worlds.
    size_t worlds;
    // Degrees of freedom of a world: columns of joint_qd, joint_f and the targets.
    size_t dofs;
    // Coordinates of a world: columns of joint_q.
    size_t coords;
    // Physics step [s].
    double dt;
    // Physics steps per control frame: each tl_step advances the worlds by substeps * dt.
    size_t substeps;
    // Frames that this client may hold at once.
    size_t frames_held;
    // "robot/joint" of each dof; dofs of them.
    const char *const *dof_names;
    // "robot/joint" of each coordinate; coords of them.
    const char *const *coord_names;
    // What each frame carries.
    const tl_array_info *fields;
    // Number of fields.
    size_t field_count;
    // What a step may set, with tl_set_f32 and tl_set_f64.
    const tl_array_info *inputs;
    // Number of inputs.
    size_t input_count;
    // What tl_write_f32 and tl_write_f64 may write.
    const tl_array_info *writes;
    // Number of arrays that may be written.
    size_t write_count;
} tl_description;

// An array of a frame. Read-only, contiguous, 64-byte aligned, valid until tl_frame_drop.
typedef struct {
    // First entry.
    const void *data;
    // Type of the entries.
    tl_dtype dtype;
    // Worlds.
    size_t rows;
    // Entries of a world: data[world * columns + column].
    size_t columns;
    // Axes in use.
    size_t axes;
    // Shape, worlds first, row-major; 1 for axes that are not in use.
    size_t shape[4];
} tl_array;

// Number and times of a frame.
typedef struct {
    // Frames that the daemon made before, and this one.
    uint64_t number;
    // Time that the daemon computed for it [ns].
    uint64_t busy_ns;
    // When the next frame is due on CLOCK_MONOTONIC, in real time; else 0 [ns].
    uint64_t due_next_ns;
} tl_frame_info;

// Percentiles of a duration, rounded up by at most 1 %; all 0 if nothing was measured [us].
typedef struct {
    // Mean.
    double mean;
    // Median.
    double p50;
    // Of 100 values, 99 are at most this.
    double p99;
    // Of 1000 values, 999 are at most this.
    double p999;
    // The largest.
    double worst;
} tl_durations;

// How frames came, measured by the daemon.
typedef struct {
    // Frames that steps made.
    uint64_t frames;
    // Frames that left more than a tenth of the period after they were due, or whose command was late.
    uint64_t missed;
    // Frames whose command had not come when they were due.
    uint64_t late;
    // Periods without a frame, because the one before took too long.
    uint64_t skipped;
    // Time between two frames that follow each other.
    tl_durations period;
    // From the time at which a frame was due until it left.
    tl_durations lateness;
    // From a command, or from the time at which its frame was due if that is later, until its frame left.
    tl_durations latency;
    // Time that the daemon computed for a frame.
    tl_durations busy;
} tl_timing;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// The sentence of the last call of this thread that failed; empty before the first one. Valid until the next one fails.
const char *tl_last_error(void);

// Attaches to a running daemon. `api_version` is TL_API_VERSION, `options` may be NULL.
//
// TL_STATUS_NO_DAEMON lists the daemons that run. TL_STATUS_PROTOCOL_VERSION names both versions of the protocol.
tl_status tl_attach(uint32_t api_version, const char *name, const tl_options *options, tl_client **client);

// What the daemon reports of itself. The pointers in it are valid until tl_detach.
tl_status tl_describe(tl_client *client, tl_description *description);

// Ends the call of this client that waits, or the next one that waits for 50 ms, with TL_STATUS_INTERRUPTED.
//
// It may be called from a signal handler. NULL does nothing.
void tl_interrupt(tl_client *client);

// Gives control back and ends the connection. Its frames stay valid. NULL does nothing.
tl_status tl_detach(tl_client *client);

// Version of the protocol that this library speaks. Daemons of another one refuse it.
uint32_t tl_protocol_version(void);

// Sets an input, such as "joint_target_q", for the next step: `count` = worlds * columns values, copied at once.
//
// The next tl_step or tl_send sends what was set, once, whatever becomes of it. An input that is not set keeps its last
// value in the daemon. TL_STATUS_UNKNOWN_NAME lists the inputs.
tl_status tl_set_f32(tl_client *client, const char *input, const float *values, size_t count);

// As tl_set_f32, of double precision.
tl_status tl_set_f64(tl_client *client, const char *input, const double *values, size_t count);

// Advances every world by one control frame, with the inputs that were set, and waits for the frame.
//
// The first call takes control of the daemon. TL_STATUS_LEASE_HELD names the process that has it. After
// TL_STATUS_REFUSED, TL_STATUS_FRAMES_HELD and TL_STATUS_STEP_IN_FLIGHT no world was touched.
tl_status tl_step(tl_client *client, tl_frame **frame);

// The first half of tl_step: sends the inputs and returns while the daemon steps.
tl_status tl_send(tl_client *client);

// The second half of tl_step: waits for the frame of the step that was sent.
tl_status tl_recv(tl_client *client, tl_frame **frame);

// Puts worlds back to the start. `mask` has a byte per world, `mask_count` of them, or is NULL for all worlds.
//
// `seeds` has one seed for all worlds or one per world, or is NULL: then each world begins its next episode.
tl_status tl_reset(tl_client *client,
                   const uint8_t *mask,
                   size_t mask_count,
                   const uint64_t *seeds,
                   size_t seed_count,
                   tl_frame **frame);

// Writes a part of the state, such as "joint_q", and evaluates the frame there: `count` = worlds * columns values.
//
// `mask` has a byte per world, `mask_count` of them: worlds with 0 keep their state. NULL is all worlds.
tl_status tl_write_f32(tl_client *client,
                       const char *field,
                       const float *values,
                       size_t count,
                       const uint8_t *mask,
                       size_t mask_count,
                       tl_frame **frame);

// As tl_write_f32, of double precision.
tl_status tl_write_f64(tl_client *client,
                       const char *field,
                       const double *values,
                       size_t count,
                       const uint8_t *mask,
                       size_t mask_count,
                       tl_frame **frame);

// Finds an array of a frame by its name, such as "joint_q". Nothing is copied.
//
// TL_STATUS_UNKNOWN_NAME lists the fields that the frame has; `tightloop serve --fields` adds others.
tl_status tl_frame_field(const tl_frame *frame, const char *name, tl_array *array);

// Number and times of a frame.
tl_status tl_frame_describe(const tl_frame *frame, tl_frame_info *info);

// Drops a frame: its slot is the daemon's again. NULL does nothing.
tl_status tl_frame_drop(tl_frame *frame);

// How frames came since the daemon started, or since a call had it `restart` the count, which this call does if
// `restart` is not 0. Without `tightloop serve --realtime`, missed, late and skipped are 0.
tl_status tl_read_timing(tl_client *client, uint8_t restart, tl_timing *timing);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* TIGHTLOOP_CLIENT_H */
