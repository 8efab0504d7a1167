/* Adds the samples of one finished pass to the film, pixel by pixel in the order of the samples, so that
   the sums have the same bits whatever order the paths ended in.

   Sums are pairs of floats (value and rounding error), 48 bits in all: float32 alone drifts after some
   ten million samples (METHODS §7). */
#pragma OPENCL FP_CONTRACT OFF

/* sum += value, error-free (Knuth's two-sum); x: sum, y: what rounding lost. */
INLINE float2 add_exactly(float2 sum, float value)
{
    const float total = sum.x + value;
    const float part = total - sum.x;
    const float lost = (sum.x - (total - part)) + (value - part);
    return (float2)(total, sum.y + lost);
}

__kernel void accumulate_kernel(__global const float *results, __global float *film, __global float *film_peaks,
#if CLVOL_RESULT_COUNTS
                                __global const uint *result_counts,
#endif
#if CLVOL_PATH_COUNTS
                                __global ulong *film_counts,
#endif
#if CLVOL_FIRST_HIT
                                __global const float *result_firsts, __global float *film_firsts,
#endif
                                __global uint *control, uint ring_pass, uint pass_jobs, uint samples, uint pixels)
{
    const uint pixel = get_global_id(0);
    if (pixel >= pixels)
        return;
    const uint jobs = samples * CLVOL_JOBS_PER_SAMPLE; /* of the pixel */
    const size_t first_job = (size_t)ring_pass * pass_jobs + (size_t)pixel * jobs;
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
        const size_t at = (size_t)pixel * CLVOL_CHANNELS + c;
        float4 f = vload4(at, film); /* sum, its error, sum of squares, its error */
        for (uint s = 0; s < samples; ++s) {
            const float x = results[(first + s) * CLVOL_CHANNELS + c];
            if (!isfinite(x))
                atomic_inc(control + CONTROL_NON_FINITE);
            const float square = x * x;
            peak = max_of(peak, abs_of(x));
            f.xy = add_exactly(f.xy, x);
            f.zw = add_exactly(f.zw, square);
            f.w += fma(x, x, -square);
        }
        vstore4(f, at, film);
    }
    film_peaks[(size_t)pixel * CLVOL_PEAKS] = peak;
#if CLVOL_FIRST_HIT
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
