// Drives one AXI4-Stream core, translated to C++ by CXXRTL, with a job of input beats.
//
// engine.py compiles it together with the core: core.cc is on the include path, CORE names the core's struct.
// Beat and Job are mirrored there.
#include "core.cc"

namespace {

using Core = cxxrtl_design::CORE;

enum Status : uint32_t { RUNNING, DONE, HANG, FULL };
enum Violation : uint32_t { VALID_DROPPED = 1, BEAT_CHANGED = 2, VALID_IN_RESET = 4 };

struct Beat {
    uint64_t data;
    uint64_t cycle;  // in which it moved
    uint32_t gap;    // cycles with tvalid low before it, of input beats
    uint8_t user, last;

    bool same(const Beat &o) const { return data == o.data && user == o.user && last == o.last; }
};
static_assert(sizeof(Beat) == 24, "numpy's aligned layout");

struct Job {  // handed over with the results at zero
    Beat *in, *out;
    uint64_t offered, expected, capacity;
    uint64_t seed, idle_enter, idle_leave, stop_enter, stop_leave;
    uint64_t watchdog, settle, reset_cycles;
    uint64_t sent, received, cycles, stall_cycles, not_ready_cycles, violations, first_violation;
    uint32_t kinds, status;
};

// An output is a wire where a register drives it, and a value elsewhere.
template <template <size_t> class Net, size_t Bits>
constexpr uint32_t width(const Net<Bits> &) { return Bits; }

// The only place that spells the core's members: CXXRTL doubles each underscore of a port's name.
struct Ports {
    Core core;

    uint32_t in_bits() const { return width(core.p_s__axis__tdata); }
    uint32_t out_bits() const { return width(core.p_m__axis__tdata); }
    // The outputs are read after the falling edge: until nothing changes, in case a register has that edge as well.
    void fall() { core.p_aclk.set<uint8_t>(0); do core.eval(); while (core.commit()); }
    void rise() { core.p_aclk.set<uint8_t>(1); core.step(); }
    void reset(bool active) { core.p_aresetn.set<uint8_t>(!active); }
    void offer(bool valid, const Beat &beat) {
        core.p_s__axis__tvalid.set<uint8_t>(valid);
        core.p_s__axis__tdata.set<uint64_t>(beat.data);
        core.p_s__axis__tuser.set<uint8_t>(beat.user);
        core.p_s__axis__tlast.set<uint8_t>(beat.last);
    }
    void accept(bool ready) { core.p_m__axis__tready.set<uint8_t>(ready); }
    bool s_ready() const { return core.p_s__axis__tready.get<uint8_t>(); }
    bool m_valid() const { return core.p_m__axis__tvalid.get<uint8_t>(); }
    Beat m_beat(uint64_t cycle) const {
        return {core.p_m__axis__tdata.get<uint64_t>(), cycle, 0,
                core.p_m__axis__tuser.get<uint8_t>(), core.p_m__axis__tlast.get<uint8_t>()};
    }
};

// A two-state chain: a pause begins with probability enter and ends with probability leave, in units of 2^-32.
// enter + leave = 2^32 draws every cycle by itself.
class Pauses {
    uint64_t state, enter, leave;
    bool paused = false;

    uint32_t random() {  // splitmix64, upper half
        uint64_t z = (state += 0x9e3779b97f4a7c15u);
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
        return uint32_t((z ^ (z >> 31)) >> 32);
    }

public:
    Pauses(uint64_t seed, uint64_t enter, uint64_t leave) : state(seed), enter(enter), leave(leave) {}
    bool draw() {
        if (enter == 0) return false;
        paused = paused ? random() >= leave : random() < enter;
        return paused;
    }
};

class Bench {
    Ports port;
    uint64_t now = 0;      // cycles since the last reset
    bool waiting = false;  // m_axis offered a beat that was not taken
    Beat held{};

    void violation(Job &job, Violation kind) {
        if (job.violations++ == 0) job.first_violation = now;
        job.kinds |= kind;
    }

    void reset(Job &job) {
        now = 0;
        waiting = false;
        port.offer(false, {});
        port.accept(false);
        port.reset(true);
        for (uint64_t cycle = 0; cycle < job.reset_cycles; cycle++) {
            port.fall();
            if (cycle + 1 == job.reset_cycles && port.m_valid()) violation(job, VALID_IN_RESET);
            port.rise();
        }
        // A master may raise tvalid only after an edge that saw aresetn high.
        port.reset(false);
        port.fall();
        port.rise();
    }

    void check_stable(Job &job, bool valid, const Beat &beat, bool ready) {
        if (waiting && !valid) violation(job, VALID_DROPPED);
        else if (waiting && !beat.same(held)) violation(job, BEAT_CHANGED);
        waiting = valid && !ready;
        held = beat;
    }

public:
    uint32_t in_bits() const { return port.in_bits(); }
    uint32_t out_bits() const { return port.out_bits(); }

    void run(Job &job) {
        if (job.reset_cycles) reset(job);
        // An even and an odd seed keep the sequences of the two sides apart.
        Pauses idle(2 * job.seed, job.idle_enter, job.idle_leave);
        Pauses stop(2 * job.seed + 1, job.stop_enter, job.stop_leave);
        uint64_t gap = job.offered ? job.in[0].gap : 0, silent = 0, settled = 0;
        bool valid = false;
        Beat beat{};
        for (; job.status == RUNNING; now++, job.cycles++) {
            const bool pending = job.sent < job.offered;
            if (pending && !valid) {
                if (gap) {
                    gap--;
                } else if (!idle.draw()) {
                    beat = job.in[job.sent];
                    valid = true;
                }
            }
            const bool ready = !stop.draw();
            port.offer(valid, beat);
            port.accept(ready);
            port.fall();

            const bool s_ready = port.s_ready(), m_valid = port.m_valid();
            const Beat m_beat = port.m_beat(now);
            const bool in_moves = valid && s_ready, out_moves = m_valid && ready;
            check_stable(job, m_valid, m_beat, ready);
            job.stall_cycles += valid && !s_ready;
            job.not_ready_cycles += !s_ready;
            // A cycle in which a side was held back from here says nothing about the core.
            if (in_moves || out_moves) silent = 0;
            else if (ready && (valid || !pending)) silent++;

            if (in_moves) {
                job.in[job.sent++].cycle = now;
                valid = false;
                if (job.sent < job.offered) gap = job.in[job.sent].gap;
            }
            if (out_moves && job.received < job.capacity) job.out[job.received++] = m_beat;
            else if (out_moves) job.status = FULL;
            port.rise();

            if (job.status == FULL) continue;
            if (job.sent == job.offered && job.received >= job.expected) {
                if (settled++ == job.settle) job.status = DONE;
            } else if (silent >= job.watchdog) {
                job.status = HANG;
            }
        }
    }
};

}  // namespace

#define EXPORT extern "C" __attribute__((visibility("default")))

EXPORT Bench *bench_new() { return new Bench; }
EXPORT void bench_delete(Bench *bench) { delete bench; }
EXPORT uint32_t bench_in_bits(const Bench *bench) { return bench->in_bits(); }
EXPORT uint32_t bench_out_bits(const Bench *bench) { return bench->out_bits(); }
EXPORT void bench_run(Bench *bench, Job *job) { bench->run(*job); }
