#include "gbt_nodes.h"

#include "gbt_math.h"

#define D GBT_DIMENSION
#define ON_TIME 1e-9 /* rounding of a time, s */

int gbt_node_before(double time, double step, int nodes, gbt_real *share)
{
    const double place = fmin(fmax(time / step, 0), nodes - 1);
    const int before = place < nodes - 1 ? (int)place : nodes - 2;
    *share = (gbt_real)(place - before);
    return before;
}

void gbt_between_nodes(double time, double step, int nodes, gbt_real *mean, gbt_real *covariance, const gbt_real *next,
                       const gbt_real *spread)
{
    const double last = step * (nodes - 1);
    const int beyond = time > last + ON_TIME;
    const gbt_real later = (gbt_real)(time - last), grown = (gbt_real)(time / last);
    gbt_real share;
    gbt_node_before(time, step, nodes, &share);
    for (int i = 0; i < D; i++) {
        const gbt_real rate = (next[i] - mean[i]) / (gbt_real)step;
        mean[i] = (1 - share) * mean[i] + share * next[i];
        if (beyond) mean[i] += later * rate;
    }
    for (int k = 0; k < D * D; k++) {
        covariance[k] = (1 - share) * covariance[k] + share * spread[k];
        if (beyond) covariance[k] *= grown * grown * grown;
    }
}
