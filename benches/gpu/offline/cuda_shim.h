// CUDA C on the processor: one thread after the other, or those of a warp in turns where they exchange values.
// `cuda_on_cpu.py` puts a kernel behind this text, and calls `play`.
#pragma once
#include <cmath>
#include <cstdint>
#include <cstring>
#include <ucontext.h>
#include <vector>

#define __global__
#define __device__
#define __forceinline__ inline
#define __launch_bounds__(threads)
struct float4 {
    float x, y, z, w;
};
static inline float4 make_float4(float x, float y, float z, float w) { return {x, y, z, w}; }
struct Number {
    unsigned x;
};
static Number blockIdx, threadIdx;

// A warp of threads, each with its own stack. A thread that gives a value waits until its peers have given theirs.
namespace warp {
constexpr unsigned LANES = 32;
static ucontext_t scheduler, threads[LANES];
static std::vector<char> stacks[LANES];
static uint32_t given[LANES], exchanges[LANES], finished;
static unsigned lane;
static void (*body)();

static void enter() {
    body();
    finished |= 1u << lane;
    swapcontext(&threads[lane], &scheduler);
}

static void switch_to(unsigned to) {
    lane = to;
    threadIdx.x = to;
    swapcontext(&scheduler, &threads[to]);
}

// Starts the threads of a warp, and lets them go on in turns until all have ended.
static void run(void (*kernel)(), unsigned count) {
    body = kernel;
    finished = 0;
    for (unsigned k = 0; k < count; k++) {
        stacks[k].resize(1 << 20);
        exchanges[k] = 0;
        getcontext(&threads[k]);
        threads[k].uc_stack.ss_sp = stacks[k].data();
        threads[k].uc_stack.ss_size = stacks[k].size();
        threads[k].uc_link = &scheduler;
        makecontext(&threads[k], enter, 0);
    }
    uint32_t all = count == LANES ? ~0u : (1u << count) - 1;
    while (finished != all)
        for (unsigned k = 0; k < count; k++)
            if (!(finished >> k & 1)) switch_to(k);
}

template <class T>
static T exchange(uint32_t peers, T value, unsigned from) {
    static_assert(sizeof(T) <= 4);
    auto wait = [&](uint32_t until) {
        for (unsigned k = 0; k < LANES; k++)
            while ((peers >> k & 1) && exchanges[k] < until) swapcontext(&threads[lane], &scheduler);
    };
    std::memcpy(&given[lane], &value, sizeof value);
    uint32_t number = ++exchanges[lane];
    wait(number);
    T found;
    std::memcpy(&found, &given[from % LANES], sizeof found);
    // nobody gives the next value before all have this one
    number = ++exchanges[lane];
    wait(number);
    return found;
}
}  // namespace warp

template <class T>
static T __shfl_sync(uint32_t peers, T value, unsigned from) {
    return warp::exchange(peers, value, from);
}
static void __syncwarp(uint32_t peers) { warp::exchange(peers, 0u, warp::lane); }
template <class T>
static T __shfl_xor_sync(uint32_t peers, T value, unsigned mask) {
    return warp::exchange(peers, value, warp::lane ^ mask);
}
