#include "gbt_breaks.h"

#include "gbt_math.h"

#define D GBT_DIMENSION
#define BROKEN ((gbt_real)1e4)      /* squared standardised innovation of a bearing that is not of the window's motion */
#define FORESEEN ((gbt_real)1e3)    /* and of one that is */
#define LEAST_SPEED ((gbt_real)1)   /* least deviation of the position at a break over the sampling interval, m/s */
#ifdef GBT_SINGLE
#define ROUNDING ((gbt_real)1.4e-14) /* variance of a bearing that is rounded, rad^2 */
#else
#define ROUNDING GBT_EPSILON
#endif

void gbt_breaks_begin(gbt_break_watch *watch)
{
    watch->count = watch->suspects = 0;
    watch->missed = 0;
    for (int k = 0; k < GBT_BEFORE; k++) watch->squares[k] = 0;
}

/* Angles along the axes of their covariance, and the variances there. */
static void along_axes(gbt_real spread[GBT_AXES][GBT_AXES], gbt_real *angle, gbt_real *variance)
{
#if GBT_DIMENSION == 2
    (void)angle;
    variance[0] = spread[0][0];
#else
    const gbt_real turn = gbt_atan2(2 * spread[0][1], spread[0][0] - spread[1][1]) / 2;
    const gbt_real c = gbt_cos(turn), s = gbt_sin(turn), x = angle[0], y = angle[1], both = 2 * c * s * spread[0][1];
    angle[0] = c * x + s * y;
    angle[1] = c * y - s * x;
    variance[0] = c * c * spread[0][0] + both + s * s * spread[1][1];
    variance[1] = s * s * spread[0][0] - both + c * c * spread[1][1];
#endif
}

/* Squared standardised innovation a component, and how far the expected position lies off the bearing, in m. */
static gbt_real unforeseen(const gbt_real *mean, const gbt_real *covariance, gbt_real noise, const gbt_real *bearing,
                           const gbt_real *own, gbt_real *missed)
{
    gbt_real line[D], unit[D], basis[GBT_AXES][D], angle[GBT_AXES], spread[GBT_AXES][GBT_AXES], variance[GBT_AXES];
    gbt_real square = 0, off = 0;
    *missed = 0;
    for (int k = 0; k < D; k++) line[k] = mean[k] - own[k];
    const gbt_real distance = gbt_length(line);
    if (!(distance > 0)) return 0;
    for (int k = 0; k < D; k++) unit[k] = line[k] / distance;
    gbt_tangent_basis(unit, basis);
    gbt_log_map(unit, bearing, basis, angle);
    for (int a = 0; a < GBT_AXES; a++) {
        off += angle[a] * angle[a];
        for (int b = 0; b < GBT_AXES; b++) {
            spread[a][b] = a == b ? noise + ROUNDING * distance * distance : 0;
            for (int i = 0; i < D; i++)
                for (int j = 0; j < D; j++) spread[a][b] += basis[a][i] * covariance[i * D + j] * basis[b][j];
            spread[a][b] /= distance * distance;
        }
    }
    *missed = gbt_sqrt(off) * distance;
    along_axes(spread, angle, variance);
    for (int a = 0; a < GBT_AXES; a++) square += angle[a] * angle[a] / gbt_fmax(variance[a], ROUNDING * ROUNDING);
    return square / GBT_AXES;
}

int gbt_breaks_judge(gbt_break_watch *watch, const gbt_real *mean, const gbt_real *covariance, gbt_real noise,
                     const gbt_real *bearing, const gbt_real *own, gbt_real elapsed, gbt_real *deviation)
{
    gbt_real missed, largest = 0;
    const gbt_real square = unforeseen(mean, covariance, noise, bearing, own, &missed);
    if (watch->suspects) {
        watch->suspects = 0;
        if (!(square > BROKEN)) return 0;
        watch->count = 0;
        *deviation = gbt_fmax(gbt_fmax(watch->missed, missed), LEAST_SPEED * elapsed);
        return 1;
    }
    for (int k = 0; k < watch->count; k++) largest = gbt_fmax(largest, watch->squares[k]);
    if (watch->count == GBT_BEFORE && largest < FORESEEN && square > BROKEN) {
        watch->suspects = 1;
        watch->missed = missed;
        return 0;
    }
    for (int k = 1; watch->count == GBT_BEFORE && k < GBT_BEFORE; k++) watch->squares[k - 1] = watch->squares[k];
    if (watch->count == GBT_BEFORE) watch->count--;
    watch->squares[watch->count++] = square;
    return 0;
}
