#include "gbt_track_memory.h"

#include "gbt_math.h"

#define SAME_TIME 1e-9 /* rounding of a time, s */

int gbt_precision_root(const gbt_real *covariance, int n, gbt_real factor, gbt_real *root)
{
    gbt_real lower[GBT_ROW_BEGIN(GBT_BOTH)], column[GBT_BOTH];
    for (int i = 0; i < n; i++)
        for (int j = 0; j <= i; j++) lower[GBT_ROW_BEGIN(i) + j] = covariance[i * n + j];
    if (!gbt_factor_lower(lower, n)) return 0;
    for (int j = 0; j < n; j++) {
        for (int i = 0; i < n; i++) column[i] = i == j;
        gbt_solve_lower(lower, n, column);
        for (int i = j; i < n; i++) root[GBT_ROW_BEGIN(i) + j] = column[i] / factor;
    }
    return 1;
}

void gbt_memory_keep(gbt_track_memory *memory, double now, gbt_real position[2][GBT_DIMENSION],
                     const gbt_real *covariance, gbt_real factor)
{
    for (int k = 1; memory->count == GBT_MEMORIES && k < GBT_MEMORIES; k++) memory->kept[k - 1] = memory->kept[k];
    if (memory->count == GBT_MEMORIES) memory->count--;
    if (!gbt_precision_root(covariance, GBT_BOTH, factor, memory->kept[memory->count].root)) return;
    memory->kept[memory->count].now = now;
    for (int k = 0; k < 2; k++)
        for (int j = 0; j < GBT_DIMENSION; j++) memory->kept[memory->count].position[k][j] = position[k][j];
    memory->count++;
}

int gbt_memory_recall(gbt_track_memory *memory, double begins, double now, double span, double between, gbt_known *known)
{
    int old = 0;
    while (old < memory->count - 1 && memory->kept[old + 1].now <= begins + SAME_TIME) old++;
    for (int k = old; old > 0 && k < memory->count; k++) memory->kept[k - old] = memory->kept[k];
    memory->count -= old;
    if (memory->count == 0 || memory->kept[0].now > begins + SAME_TIME || memory->kept[0].now - between < now - span)
        return 0;
    known->count = 2;
    for (int k = 0; k < 2; k++) {
        known->time[k] = memory->kept[0].now - k * between;
        for (int j = 0; j < GBT_DIMENSION; j++) known->position[k][j] = memory->kept[0].position[k][j];
    }
    for (int k = 0; k < GBT_ROW_BEGIN(GBT_BOTH); k++) known->root[k] = memory->kept[0].root[k];
    return 1;
}
