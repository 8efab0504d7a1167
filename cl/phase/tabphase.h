/* A phase function by table, linear in the cosine between its points (Mitsuba's tabphase).

   The table is in the lobes' buffer: records of three floats, as far behind the lobe as it says.  The first has the
   number of the last point; then each point has x = 1 - cos, the value per solid angle, and the share of directions
   that are nearer to straight on.  Peaks are ahead, where x and the shares keep their relative precision. */
#ifndef CLVOL_PHASE_TABPHASE_H
#define CLVOL_PHASE_TABPHASE_H
#include "core/shared.h"
#include "phase/about.h"

typedef struct {
    __global const float *points;
    int last;
} PhaseTable;

#define TABLE_X 0
#define TABLE_VALUE 1
#define TABLE_SHARE 2

INLINE PhaseTable phase_table(__global const Phase *lobe)
{
    __global const float *head = (__global const float *)(lobe + as_int(lobe->g));
    const PhaseTable table = {head + 3, as_int(head[0])};
    return table;
}

INLINE float table_entry(const PhaseTable *table, int point, int column) { return table->points[3 * point + column]; }

/* The last point but one, or before, whose entry is at most `at`: the beginning of an interval. */
INLINE int table_interval(const PhaseTable *table, int column, float at)
{
    int low = 0, high = table->last;
    while (high - low > 1) {
        const int middle = (low + high) / 2;
        if (table_entry(table, middle, column) <= at)
            low = middle;
        else
            high = middle;
    }
    return low;
}

INLINE float tabphase_pdf(__global const Phase *lobe, float3 wo, float3 wi)
{
    const PhaseTable table = phase_table(lobe);
    const float3 difference = wo - wi; /* half its square is 1 - cos, exactly so near 0 */
    const float x = min_of(0.5f * dot_of(difference, difference), 2.0f);
    const int n = table_interval(&table, TABLE_X, x);
    const float x0 = table_entry(&table, n, TABLE_X), width = table_entry(&table, n + 1, TABLE_X) - x0;
    const float from = table_entry(&table, n, TABLE_VALUE), to = table_entry(&table, n + 1, TABLE_VALUE);
    return from + (to - from) * ((x - x0) / width);
}

/* By inversion: within an interval the share is a square in x, whose root is taken without cancellation. */
INLINE float3 tabphase_sample(__global const Phase *lobe, float3 wo, float u, float v, float *pdf)
{
    const PhaseTable table = phase_table(lobe);
    const int n = table_interval(&table, TABLE_SHARE, u);
    const float x0 = table_entry(&table, n, TABLE_X), width = table_entry(&table, n + 1, TABLE_X) - x0;
    const float from = table_entry(&table, n, TABLE_VALUE), to = table_entry(&table, n + 1, TABLE_VALUE);
    const float share = table_entry(&table, n, TABLE_SHARE), whole = table_entry(&table, n + 1, TABLE_SHARE) - share;
    const float rest = max_of(u - share, 1e-8f * whole) * (2.0f * INV_FOUR_PI);
    const float square = from * from + 2.0f * rest * ((to - from) / width);
    *pdf = max_of(sqrt_of(max_of(square, 0.0f)), 1e-6f * (from + to)); /* what is drawn has a density */
    const float x = min_of(x0 + min_of(2.0f * rest / (from + *pdf), width), 2.0f);
    return direction_about(wo, (float2)(x, 2.0f - x), v);
}

#endif
