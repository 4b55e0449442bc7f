#include "gbt_mixed.h"

#include "gbt_bearing.h"
#include "gbt_math.h"

#define D GBT_DIMENSION
#define R (GBT_DIMENSION + 1)            /* numbers of a direction and a log range */
#define NEAREST_RANGE ((gbt_real)1e-3)   /* least range whose logarithm is taken, m */
#define LEAST_LENGTH ((gbt_real)1e-9)    /* of a mean of directions */

void gbt_mix(gbt_real *mean, gbt_real *covariance, int n, gbt_real before, gbt_real weight, const gbt_real *part,
             const gbt_real *spread)
{
    const gbt_real share = weight / (before + weight);
    if (!(before > 0)) {
        for (int i = 0; i < n; i++) mean[i] = part[i];
        for (int i = 0; i < n * n; i++) covariance[i] = spread[i];
        return;
    }
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            const gbt_real apart = (part[i] - mean[i]) * (part[j] - mean[j]);
            covariance[i * n + j] += share * (spread[i * n + j] - covariance[i * n + j]) + share * (1 - share) * apart;
        }
    for (int i = 0; i < n; i++) mean[i] += share * (part[i] - mean[i]);
}

void gbt_mixed_begin(gbt_mixed *mixed, int at_median)
{
    mixed->at_median = at_median;
    mixed->weight = 0;
}

void gbt_mixed_add(gbt_mixed *mixed, gbt_real weight, const gbt_real *position, const gbt_real *covariance)
{
    if (!(weight > 0)) return;
    if (!mixed->at_median) {
        gbt_mix(mixed->mean, mixed->covariance, D, mixed->weight, weight, position, covariance);
    } else {
        const gbt_real range = gbt_fmax(gbt_length(position), NEAREST_RANGE), square = range * range;
        gbt_real part[R], spread[R * R];
        part[D] = gbt_log(range);
        spread[R * R - 1] = 0;
        for (int i = 0; i < D; i++) {
            part[i] = position[i] / range;
            spread[i * R + D] = spread[D * R + i] = 0;
            for (int j = 0; j < D; j++) spread[i * R + j] = covariance[i * D + j] / square;
        }
        gbt_mix(mixed->mean, mixed->covariance, R, mixed->weight, weight, part, spread);
    }
    mixed->weight += weight;
}

void gbt_mixed_moments(const gbt_mixed *mixed, gbt_real *mean, gbt_real *covariance)
{
    const gbt_real *joint = mixed->covariance, *unit = mixed->mean;
    if (!mixed->at_median) {
        for (int i = 0; i < D; i++) mean[i] = mixed->mean[i];
        for (int i = 0; i < D * D; i++) covariance[i] = mixed->covariance[i];
        return;
    }
    /* a part is off by the difference of its log range along the mean direction, and by that of its direction from it */
    const gbt_real range = gbt_exp(mixed->mean[D]), length = gbt_fmax(gbt_length(unit), LEAST_LENGTH);
    gbt_real middle[D], shorter[D];
    for (int i = 0; i < D; i++) {
        middle[i] = unit[i] / length;
        shorter[i] = unit[i] - middle[i];
        mean[i] = range * middle[i];
    }
    for (int i = 0; i < D; i++)
        for (int j = 0; j < D; j++) {
            const gbt_real along = joint[R * R - 1] * middle[i] * middle[j];
            const gbt_real crossed = middle[i] * joint[D * R + j] + joint[i * R + D] * middle[j];
            covariance[i * D + j] = range * range * (joint[i * R + j] + along + crossed + shorter[i] * shorter[j]);
        }
}

gbt_real gbt_relative_range_std(const gbt_real *line, const gbt_real *covariance, int row)
{
    const gbt_real square = gbt_dot(line, line);
    gbt_real along = 0;
    for (int i = 0; i < D; i++)
        for (int j = 0; j < D; j++) along += line[i] * covariance[i * row + j] * line[j];
    if (!(square > 0)) return GBT_INFINITY;
    return gbt_sqrt(along > 0 || isnan(along) ? along : 0) / square;
}
