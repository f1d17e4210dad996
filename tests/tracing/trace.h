// Code that goes in front of a kernel module compiled for the CPU. It renames the functions that generated code
// reads, writes and computes with, so that each access is seen with its thread, and each operation is counted.
// The layout of ``Region`` and ``Trace`` is that of tests/tracing/trace.py.

namespace traced {

using u32 = unsigned int;
using u64 = unsigned long long;

constexpr u32 SEVERAL = 0xFFFFFFFF; // more than one thread
constexpr u32 ATOMIC = 0xFFFFFFFE; // written by atomic operations only
constexpr u64 WORD = 4;
constexpr u64 STACK = 1 << 20; // most that the variables of a kernel take

struct Region { // memory of an array, and what the launch has done with each of its words
    const char* begin;
    const char* end;
    u32* writer; // thread + 1, 0: none
    u32* reader;
    u64 bytes_read; // as often as they were asked for
    u64 bytes_written;
    u64 races[4]; // written twice, twice with the same bits, read by another thread, float atomics
    u64 word; // of the first race of the last kind that was found
};

struct Trace {
    const u32* order; // the threads in the order in which they run
    Region* regions;
    u64 region_count;
    u64 outside; // accesses to memory of no array
    u64 simple; // floating-point additions, products, comparisons ...
    u64 slow; // divisions and square roots
    u64 thread; // the one that runs, + 1
    u64 thread_loads; // its loads so far
    u64 longest; // most loads of a thread
    u64 last; // region of the last access
};

static Trace* trace;

static inline Region* find(const void* address)
{
    const char* at = (const char*)address;
    for (u64 n = 0; n < trace->region_count; ++n) {
        u64 k = trace->last + n;
        if (k >= trace->region_count)
            k -= trace->region_count;
        Region& region = trace->regions[k];
        if (at >= region.begin && at < region.end) {
            trace->last = k;
            return &region;
        }
    }
    const char* frame = (const char*)__builtin_frame_address(0);
    if (at < frame || at > frame + STACK) // fields of a struct are on the stack
        ++trace->outside;
    return nullptr;
}

static inline void report(Region& region, int kind, u64 word)
{
    if (!region.races[kind]++)
        region.word = word;
}

[[gnu::noinline]] static void read(const void* address, u64 size)
{
    Region* region = find(address);
    ++trace->thread_loads;
    if (!region)
        return;
    region->bytes_read += size;
    const u32 own = (u32)trace->thread;
    const u64 first = ((const char*)address - region->begin) / WORD;
    for (u64 w = first; w < first + (size + WORD - 1) / WORD; ++w) {
        const u32 writer = region->writer[w];
        if (writer && writer != own)
            report(*region, 2, w);
        u32& reader = region->reader[w];
        reader = !reader || reader == own ? own : SEVERAL;
    }
}

[[gnu::noinline]] static void write(const void* address, const void* value, u64 size)
{
    Region* region = find(address);
    if (!region)
        return;
    region->bytes_written += size;
    const u32 own = (u32)trace->thread;
    const u64 first = ((const char*)address - region->begin) / WORD;
    const u64 words = (size + WORD - 1) / WORD;
    for (u64 i = 0; i < words; ++i) {
        const u64 w = first + i;
        u32& writer = region->writer[w];
        if (writer && writer != own)
            report(*region, ((const u32*)address)[i] == ((const u32*)value)[i] ? 1 : 0, w);
        const u32 reader = region->reader[w];
        if (reader && reader != own)
            report(*region, 2, w);
        writer = !writer || writer == own ? own : SEVERAL;
    }
}

[[gnu::noinline]] static void update(const void* address, u64 size, bool is_float)
{
    Region* region = find(address);
    if (!region)
        return;
    region->bytes_read += size;
    region->bytes_written += size;
    const u64 w = ((const char*)address - region->begin) / WORD;
    u32& writer = region->writer[w];
    if ((writer && writer != ATOMIC) || region->reader[w])
        report(*region, 2, w);
    if (is_float)
        report(*region, 3, w);
    writer = ATOMIC;
}

static inline size_t begin(size_t index)
{
    if (trace->thread_loads > trace->longest)
        trace->longest = trace->thread_loads;
    trace->thread_loads = 0;
    if (trace->order)
        index = trace->order[index];
    trace->thread = index + 1;
    return index;
}

template <typename T> struct Floats { // components that are floats
    static constexpr u64 count = 0;
};
template <> struct Floats<wp::float32> {
    static constexpr u64 count = 1;
};
template <> struct Floats<wp::float64> {
    static constexpr u64 count = 1;
};
template <unsigned N> struct Floats<wp::vec_t<N, wp::float32>> {
    static constexpr u64 count = N;
};

} // namespace traced

#define TRACED_OPERATION(name, kind, factor) \
    namespace wp { \
    template <typename... A> inline auto traced_##name(const A&... a) \
    { \
        auto result = name(a...); \
        traced::trace->kind += factor * traced::Floats<decltype(result)>::count; \
        return result; \
    } \
    }

// By the components of the argument: a product and a sum of each.
#define TRACED_PRODUCT(name, slow_count) \
    namespace wp { \
    template <typename T, typename... A> inline auto traced_##name(const T& v, const A&... a) \
    { \
        traced::trace->simple += 2 * traced::Floats<T>::count; \
        traced::trace->slow += slow_count; \
        return name(v, a...); \
    } \
    }

TRACED_OPERATION(add, simple, 1)
TRACED_OPERATION(sub, simple, 1)
TRACED_OPERATION(mul, simple, 1)
TRACED_OPERATION(cw_mul, simple, 1)
TRACED_OPERATION(min, simple, 1)
TRACED_OPERATION(max, simple, 1)
TRACED_OPERATION(abs, simple, 1)
TRACED_OPERATION(neg, simple, 1)
TRACED_OPERATION(floor, simple, 1)
TRACED_OPERATION(clamp, simple, 2)
TRACED_OPERATION(div, slow, 1)
TRACED_OPERATION(cw_div, slow, 1)
TRACED_OPERATION(sqrt, slow, 1)
TRACED_PRODUCT(dot, 0)
TRACED_PRODUCT(length_sq, 0)
TRACED_PRODUCT(length, 1)

namespace wp {

template <typename T> inline T traced_load(T* address)
{
    traced::read(address, sizeof(T));
    return load(address);
}

// Shapes of arrays, and arrays in structs, are arguments of the launch.
inline shape_t traced_load(shape_t* address) { return load(address); }
template <typename T> inline array_t<T> traced_load(array_t<T>* address) { return load(address); }

template <typename T> inline void traced_store(T* address, T value)
{
    traced::write(address, &value, sizeof(T));
    store(address, value);
}

template <typename A, typename V> inline void traced_array_store(const A& array, int i, V value)
{
    auto* at = address(array, i);
    traced::write(at, &value, sizeof(*at));
    array_store(array, i, value);
}
template <typename A, typename V> inline void traced_array_store(const A& array, int i, int j, V value)
{
    auto* at = address(array, i, j);
    traced::write(at, &value, sizeof(*at));
    array_store(array, i, j, value);
}
template <typename A, typename V> inline void traced_array_store(const A& array, int i, int j, int k, V value)
{
    auto* at = address(array, i, j, k);
    traced::write(at, &value, sizeof(*at));
    array_store(array, i, j, k, value);
}

} // namespace wp

#define TRACED_ATOMIC(name) \
    namespace wp { \
    template <typename A, typename V> inline auto traced_##name(const A& array, int i, V value) \
    { \
        traced::update(address(array, i), sizeof(V), traced::Floats<V>::count > 0); \
        return name(array, i, value); \
    } \
    template <typename A, typename V> inline auto traced_##name(const A& array, int i, int j, V value) \
    { \
        traced::update(address(array, i, j), sizeof(V), traced::Floats<V>::count > 0); \
        return name(array, i, j, value); \
    } \
    }

TRACED_ATOMIC(atomic_add)
TRACED_ATOMIC(atomic_sub)
TRACED_ATOMIC(atomic_min)
TRACED_ATOMIC(atomic_max)
TRACED_ATOMIC(atomic_and)
TRACED_ATOMIC(atomic_or)
TRACED_ATOMIC(atomic_xor)
TRACED_ATOMIC(atomic_exch)

extern "C" WP_API void warpsplat_trace(traced::Trace* trace) { traced::trace = trace; }

#define load traced_load
#define store traced_store
#define array_store traced_array_store
#define atomic_add traced_atomic_add
#define atomic_sub traced_atomic_sub
#define atomic_min traced_atomic_min
#define atomic_max traced_atomic_max
#define atomic_and traced_atomic_and
#define atomic_or traced_atomic_or
#define atomic_xor traced_atomic_xor
#define atomic_exch traced_atomic_exch
#define add traced_add
#define sub traced_sub
#define mul traced_mul
#define cw_mul traced_cw_mul
#define min traced_min
#define max traced_max
#define abs traced_abs
#define neg traced_neg
#define floor traced_floor
#define clamp traced_clamp
#define div traced_div
#define cw_div traced_cw_div
#define sqrt traced_sqrt
#define dot traced_dot
#define length_sq traced_length_sq
#define length traced_length

#undef builtin_tid1d
#undef builtin_tid2d
#undef builtin_tid3d
#define builtin_tid1d() wp::linear_tid<wp_linear_tid>(traced::begin(task_index), dim)
#define builtin_tid2d(x, y) wp::tid(x, y, traced::begin(task_index), dim)
#define builtin_tid3d(x, y, z) wp::tid(x, y, z, traced::begin(task_index), dim)
