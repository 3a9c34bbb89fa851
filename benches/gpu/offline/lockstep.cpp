// Runs programs of bytecode.py for warps of 32 lanes in lockstep, and counts what a warp does per stretch of lines.
//
// A register of the machine is a slot: 32 values of 32 bits. `exec` masks the lanes that take part.

#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

constexpr int LANES = 32;
typedef float F __attribute__((vector_size(4 * LANES)));
typedef uint32_t U __attribute__((vector_size(4 * LANES)));
typedef int32_t M __attribute__((vector_size(4 * LANES)));

// bytecode.py reads the numbers of operations from this list; MOVE and NOT work for every type
enum Operation : int32_t {
    END, ENTER, RETURN_IF, BREAK_IF, IF, END_IF, LOOP, TEST, NEXT, END_LOOP,
    MOVE, SET, NEG, NOT, SQRT, ABS, ROUND, FMA, SELECT, TO_F32, TO_U32,
    ADD_F, SUB_F, MUL_F, DIV_F, MIN_F, MAX_F, LT_F, GT_F, LE_F, GE_F, EQ_F, NE_F,
    ADD_U, SUB_U, MUL_U, DIV_U, MOD_U, MIN_U, MAX_U, LT_U, GT_U, LE_U, GE_U, EQ_U, NE_U,
    AND, OR, LOAD, LOAD_4, STORE, STORE_4, ENTRY, SHUFFLE, SHUFFLE_XOR, SUM_F, SUM_U
};

struct Instruction {
    int32_t operation, to, a, b, c;
};

// A buffer of worlds. Marks tell which sectors of 32 bytes (two neighbouring worlds) of a vector a warp has touched: in this dispatch,
// and by the access that runs.
struct Memory {
    float* values;
    uint32_t* touched;
    uint32_t* now;
    uint8_t* ever;  // (vectors, pairs of worlds): sectors that any dispatch of the frame touched
    uint64_t places;
};

struct Job {
    const Instruction* code;
    const uint32_t (*constants)[2];
    uint32_t constant_count, slot_count, stretch_count, worlds, share;
    Memory memory[2];
    const uint32_t* tables[2];
    uint64_t table_lengths[2];
};

// Of a dispatch; arrays are (warps, stretches) or (stretches), bytes and sectors are totals of all warps.
struct Tally {
    uint32_t* visits;
    uint32_t* cold;         // visits with a load whose sector the warp had not touched
    uint64_t* lanes;        // lanes that took part
    uint64_t* loaded;       // [bytes] asked for by lanes
    uint64_t* stored;
    uint64_t* load_sectors;
    uint64_t* store_sectors;
    uint64_t (*first)[2];   // (warps, 2): sectors that the warp touched first, by loads and by stores
    uint64_t strays;        // lanes that read a lane which does not take part, or of another world
    uint64_t outside;       // accesses beyond the end of a buffer
};

static M masked(const U& a) { return (M)a; }

static bool any(const M& mask) {
    int found = 0;
    for (int k = 0; k < LANES; k++) found |= mask[k];
    return found != 0;
}

static uint32_t count(const M& mask) {
    int n = 0;
    for (int k = 0; k < LANES; k++) n -= mask[k];
    return (uint32_t)n;
}

struct Warp {
    const Job& job;
    Tally& tally;
    std::vector<U>& slots;
    U world;
    M exec;
    std::vector<M> stack;
    uint32_t stretch = 0, is_cold = 0;
    uint64_t first[2] = {0, 0};

    U& u(int32_t k) { return slots[k]; }
    F& f(int32_t k) { return (F&)slots[k]; }
    M& m(int32_t k) { return (M&)slots[k]; }

    void leave() {
        tally.cold[stretch] += is_cold;
        is_cold = 0;
    }

    // counts the sectors of an access; those that the warp touches for the first time are cold
    uint64_t touch(const Memory& memory, const U& place, int kind) {
        uint64_t moved = 0, fresh = 0;
        uint32_t pair = world[0] / 2;
        for (int k = 0; k < LANES; k++) {
            if (!exec[k]) continue;
            uint32_t q = place[k], bit = 1u << (world[k] / 2 - pair);
            if (q >= memory.places) {
                tally.outside++;
                exec[k] = 0;
                continue;
            }
            if (memory.now[q] & bit) continue;
            memory.now[q] |= bit;
            moved++;
            fresh += !(memory.touched[q] & bit);
            memory.touched[q] |= bit;
            memory.ever[(uint64_t)q * ((job.worlds + 1) / 2) + world[k] / 2] = 1;
        }
        for (int k = 0; k < LANES; k++)
            if (exec[k]) memory.now[place[k]] = 0;
        first[kind] += fresh;
        is_cold |= kind == 0 && fresh > 0;
        return moved;
    }

    const float* at(const Memory& memory, const U& place, int k) {
        return memory.values + 4 * ((uint64_t)place[k] * job.worlds + world[k]);
    }

    void load(const Memory& memory, const U& place, int32_t to, int width, const U& component) {
        tally.load_sectors[stretch] += touch(memory, place, 0);
        tally.loaded[stretch] += 4 * width * count(exec);
        for (int k = 0; k < LANES; k++) {
            if (!exec[k]) continue;
            const float* from = at(memory, place, k);
            for (int n = 0; n < width; n++) f(to + n)[k] = from[width == 4 ? n : component[k]];
        }
    }

    void store(const Memory& memory, const U& place, int32_t from, int width, const U& component) {
        tally.store_sectors[stretch] += touch(memory, place, 1);
        tally.stored[stretch] += 4 * width * count(exec);
        for (int k = 0; k < LANES; k++) {
            if (!exec[k]) continue;
            float* to = (float*)at(memory, place, k);
            for (int n = 0; n < width; n++) to[width == 4 ? n : component[k]] = f(from + n)[k];
        }
    }

    void entry(int table, const U& index, U& to) {
        for (int k = 0; k < LANES; k++) {
            if (!exec[k]) continue;
            bool inside = index[k] < job.table_lengths[table];
            tally.outside += !inside;
            to[k] = inside ? job.tables[table][index[k]] : 0;
        }
    }

    void shuffle(const U& a, const U& from, U& to) {
        U r = a;
        for (int k = 0; k < LANES; k++) {
            if (!exec[k]) continue;
            uint32_t lane = from[k] % LANES;
            tally.strays += !exec[lane] || lane / job.share != k / job.share;
            r[k] = a[lane];
        }
        to = r;
    }

    template <class T, class V>
    V sum(const V& a) {
        T total = 0;
        for (int k = 0; k < LANES; k++)
            if (exec[k]) total += a[k];
        return V{} + total;
    }

    void run(uint32_t first_thread);
};

#define EACH(to, expression) \
    for (int k = 0; k < LANES; k++) to[k] = expression

void Warp::run(uint32_t first_thread) {
    U lanes;
    EACH(lanes, (uint32_t)k);
    u(0) = lanes + first_thread;
    u(1) = U{} + job.worlds;
    exec = M{} - 1;
    world = u(0) / job.share;
    for (const Instruction* at = job.code;; at++) {
        const auto [operation, to, a, b, c] = *at;
        switch (operation) {
            case END: leave(); return;
            case ENTER:
                leave();
                stretch = (uint32_t)to;
                tally.visits[stretch]++;
                tally.lanes[stretch] += count(exec);
                break;
            case RETURN_IF:
                exec &= ~m(a);
                if (!any(exec)) { leave(); return; }
                break;
            case IF:
                stack.push_back(exec);
                exec &= m(a);
                if (!any(exec)) at = job.code + to - 1;
                break;
            case END_IF: exec = stack.back(); stack.pop_back(); break;
            // keeps the mask of the loop, then that of the lanes which go on, and the place of its end
            case LOOP:
                stack.push_back(exec);
                stack.push_back(exec);
                stack.push_back(M{} + to);
                break;
            case TEST:
            case BREAK_IF: {
                M& live = stack[stack.size() - 2];
                live &= operation == TEST ? (M)(u(a) < u(b)) : ~(exec & m(a));
                exec = live;
                if (!any(exec)) at = job.code + stack.back()[0] - 1;
                break;
            }
            // lanes go on from where the limit is computed
            case NEXT: exec = stack[stack.size() - 2]; at = job.code + to - 1; break;
            case END_LOOP:
                exec = stack[stack.size() - 3];
                stack.resize(stack.size() - 3);
                break;
            case MOVE: u(to) = u(a); break;
            case SET: u(to) = exec ? u(a) : u(to); break;
            case NEG: f(to) = -f(a); break;
            case NOT: u(to) = ~u(a); break;
            case SQRT: EACH(f(to), std::sqrt(f(a)[k])); break;
            case ABS: u(to) = u(a) & 0x7fffffffu; break;
            case ROUND: EACH(f(to), std::nearbyint(f(a)[k])); break;
            case FMA: EACH(f(to), __builtin_fmaf(f(a)[k], f(b)[k], f(c)[k])); break;
            case SELECT: u(to) = masked(u(c)) ? u(b) : u(a); break;
            case TO_F32: f(to) = __builtin_convertvector(u(a), F); break;
            case TO_U32: u(to) = __builtin_convertvector(f(a), U); break;
            case ADD_F: f(to) = f(a) + f(b); break;
            case SUB_F: f(to) = f(a) - f(b); break;
            case MUL_F: f(to) = f(a) * f(b); break;
            case DIV_F: f(to) = f(a) / f(b); break;
            case MIN_F: f(to) = f(a) < f(b) ? f(a) : f(b); break;
            case MAX_F: f(to) = f(a) > f(b) ? f(a) : f(b); break;
            case LT_F: m(to) = f(a) < f(b); break;
            case GT_F: m(to) = f(a) > f(b); break;
            case LE_F: m(to) = f(a) <= f(b); break;
            case GE_F: m(to) = f(a) >= f(b); break;
            case EQ_F: m(to) = f(a) == f(b); break;
            case NE_F: m(to) = f(a) != f(b); break;
            case ADD_U: u(to) = u(a) + u(b); break;
            case SUB_U: u(to) = u(a) - u(b); break;
            case MUL_U: u(to) = u(a) * u(b); break;
            case DIV_U: EACH(u(to), u(b)[k] ? u(a)[k] / u(b)[k] : u(a)[k]); break;
            case MOD_U: EACH(u(to), u(b)[k] ? u(a)[k] % u(b)[k] : 0); break;
            case MIN_U: u(to) = u(a) < u(b) ? u(a) : u(b); break;
            case MAX_U: u(to) = u(a) > u(b) ? u(a) : u(b); break;
            case LT_U: m(to) = u(a) < u(b); break;
            case GT_U: m(to) = u(a) > u(b); break;
            case LE_U: m(to) = u(a) <= u(b); break;
            case GE_U: m(to) = u(a) >= u(b); break;
            case EQ_U: m(to) = u(a) == u(b); break;
            case NE_U: m(to) = u(a) != u(b); break;
            case AND: u(to) = u(a) & u(b); break;
            case OR: u(to) = u(a) | u(b); break;
            case LOAD: load(job.memory[a], u(b), to, 1, u(c)); break;
            case LOAD_4: load(job.memory[a], u(b), to, 4, u(b)); break;
            case STORE: store(job.memory[to], u(a), c, 1, u(b)); break;
            case STORE_4: store(job.memory[to], u(a), b, 4, u(a)); break;
            case ENTRY: entry(a, u(b), u(to)); break;
            case SHUFFLE: shuffle(u(a), u(b), u(to)); break;
            case SHUFFLE_XOR: shuffle(u(a), lanes ^ u(b), u(to)); break;
            case SUM_F: f(to) = sum<float>(f(a)); break;
            case SUM_U: u(to) = sum<uint32_t>(u(a)); break;
        }
    }
}

// One dispatch of a kernel, warp after warp.
extern "C" void run(const Job* job, Tally* tally) {
    std::vector<U> slots(job->slot_count);
    for (uint32_t k = 0; k < job->constant_count; k++) slots[job->constants[k][0]] = U{} + job->constants[k][1];
    Tally own = *tally;
    for (uint32_t thread = 0; thread < job->worlds * job->share; thread += LANES) {
        for (const Memory& memory : job->memory) std::memset(memory.touched, 0, 4 * memory.places);
        Warp warp{*job, own, slots, {}, {}, {}};
        warp.run(thread);
        std::memcpy(*own.first++, warp.first, sizeof warp.first);
        own.visits += job->stretch_count;
        own.cold += job->stretch_count;
    }
    tally->strays = own.strays;
    tally->outside = own.outside;
}
