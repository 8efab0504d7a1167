/* Adds the samples of one finished pass to the film, pixel by pixel in the order of the samples, so that
   the sums have the same bits whatever order the paths ended in.

   Sums are pairs of floats (value and rounding error), 48 bits in all: float32 alone drifts (METHODS §7). */
#include "core/scene.h"

#pragma OPENCL FP_CONTRACT OFF

/* The pair whose x is the float nearest to its sum: y stays below the last digit of x, or it would drift itself. */
INLINE float2 settled(float2 sum)
{
    const float total = sum.x + sum.y;
    return (float2)(total, sum.y - (total - sum.x));
}

/* sum += value, to 48 bits (Knuth's two-sum); x: sum, y: what rounding lost. */
INLINE float2 add_exactly(float2 sum, float value)
{
    const float total = sum.x + value;
    const float part = total - sum.x;
    const float lost = (sum.x - (total - part)) + (value - part);
    return settled((float2)(total, sum.y + lost));
}

#if CLVOL_RANDOMIZATIONS
#define FILM_PARTS CLVOL_RANDOMIZATIONS
/* The sum of each randomisation's samples. */
INLINE void add_samples(__global const float *values, uint samples, uint first_sample, __global float *film)
{
    for (uint r = 0; r < CLVOL_RANDOMIZATIONS; ++r) {
        float2 sum = vload2(r * CLVOL_CHANNELS, film);
        for (uint s = (r - first_sample) % CLVOL_RANDOMIZATIONS; s < samples; s += CLVOL_RANDOMIZATIONS)
            sum = add_exactly(sum, values[s * CLVOL_CHANNELS]);
        vstore2(sum, r * CLVOL_CHANNELS, film);
    }
}
#else
#define FILM_PARTS 2
/* The sum of the samples, and that of their squares. */
INLINE void add_samples(__global const float *values, uint samples, uint first_sample, __global float *film)
{
    float2 sum = vload2(0, film), squares = vload2(CLVOL_CHANNELS, film);
    for (uint s = 0; s < samples; ++s) {
        const float x = values[s * CLVOL_CHANNELS];
        const float square = x * x;
        sum = add_exactly(sum, x);
        squares = add_exactly(squares, square);
        squares = settled((float2)(squares.x, squares.y + fma(x, x, -square)));
    }
    vstore2(sum, 0, film);
    vstore2(squares, CLVOL_CHANNELS, film);
}
#endif

__kernel void accumulate_kernel(__global const float *results, __global float *film, __global float *film_peaks,
#if CLVOL_RESULT_COUNTS
                                __global const uint *result_counts,
#endif
#if CLVOL_PATH_COUNTS
                                __global ulong *film_counts,
#endif
#if CLVOL_FIRSTS
                                __global const float *result_firsts, __global float *film_firsts,
#endif
#if CLVOL_PIXEL_LIST
                                __global const uint *pixel_list,
#endif
                                __global uint *counters, uint ring_pass, uint pass_jobs, uint samples,
                                uint first_sample, uint pixels)
{
    uint pixel = get_global_id(0);
    if (pixel >= pixels)
        return;
    const uint jobs = samples * CLVOL_JOBS_PER_SAMPLE; /* of the pixel */
    const size_t first_job = (size_t)ring_pass * pass_jobs + (size_t)pixel * jobs;
#if CLVOL_PIXEL_LIST
    const uint2 entry = vload2(pixel, pixel_list); /* a pixel, and how many samples it has */
    pixel = entry.x;
    first_sample += entry.y;
#endif
    const size_t first = first_job / CLVOL_JOBS_PER_SAMPLE;
#if CLVOL_PATH_COUNTS
    for (uint n = 0; n < CLVOL_PATH_COUNTS; ++n) {
        ulong total = 0;
        for (uint job = 0; job < jobs; ++job)
            total += result_counts[(first_job + job) * CLVOL_RESULT_COUNTS + n];
        film_counts[(size_t)pixel * CLVOL_PATH_COUNTS + n] += total;
    }
#endif
    float peak = film_peaks[(size_t)pixel * CLVOL_PEAKS];
    for (uint c = 0; c < CLVOL_CHANNELS; ++c) {
        __global const float *values = results + first * CLVOL_CHANNELS + c;
        for (uint s = 0; s < samples; ++s) {
            const float x = values[s * CLVOL_CHANNELS];
            if (!isfinite(x))
                atomic_inc(counters + COUNTER_NON_FINITE);
            peak = max_of(peak, abs_of(x));
        }
        add_samples(values, samples, first_sample, film + (size_t)pixel * (2 * FILM_PARTS * CLVOL_CHANNELS) + 2 * c);
    }
    film_peaks[(size_t)pixel * CLVOL_PEAKS] = peak;
#if CLVOL_FIRSTS
    for (uint n = 0; n < CLVOL_FIRST_HIT_FIELDS; ++n) {
        const size_t at = (size_t)pixel * CLVOL_FIRST_HIT_FIELDS + n;
        float2 sum = vload2(at, film_firsts);
        for (uint job = 0; job < jobs; ++job)
            sum = add_exactly(sum, result_firsts[(first_job + job) * CLVOL_FIRST_HIT_FIELDS + n]);
        vstore2(sum, at, film_firsts);
    }
#endif
#if CLVOL_PEAKS > 1 /* the largest weight, the last of a result's numbers */
    float weight = film_peaks[(size_t)pixel * CLVOL_PEAKS + 1];
    for (uint job = 0; job < jobs; ++job)
        weight = max_of(weight, as_float(result_counts[(first_job + job) * CLVOL_RESULT_COUNTS + CLVOL_PATH_COUNTS]));
    film_peaks[(size_t)pixel * CLVOL_PEAKS + 1] = weight;
#endif
}
