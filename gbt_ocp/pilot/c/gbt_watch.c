#include "gbt_watch.h"

#include "gbt_bearing.h"
#include "gbt_math.h"

#define D GBT_DIMENSION
#define MANY_TIMES ((gbt_real)6)                             /* deviations above which a bearing is off */
#define LOST_DIRECTION ((gbt_real)0.5)                       /* deviation of the direction of a lost track, rad */
#define LEAST_ANGLE_STD ((gbt_real)0.0052359877559829881566) /* least deviation that counts as noise: 0.3 degrees */

/* Variance of the direction of a line, the mean over its axes; not a number where it is not known. */
static gbt_real spread_of(const gbt_real *line, const gbt_real covariance[D][D])
{
    const gbt_real square = gbt_dot(line, line);
    gbt_real along = 0, trace = 0;
    if (!(square > 0)) return (gbt_real)NAN;
    for (int i = 0; i < D; i++) {
        trace += covariance[i][i];
        for (int j = 0; j < D; j++) along += line[i] * covariance[i][j] * line[j];
    }
    return (trace - along / square) / (D - 1) / square;
}

void gbt_watch_forecast(gbt_watch *watch, const gbt_forecast *forecast, const gbt_real *own)
{
    gbt_real line[D];
    for (int k = 0; k < D; k++) line[k] = forecast->mean[0][k] - own[k];
    watch->vague = spread_of(line, forecast->covariance[0]) > LOST_DIRECTION * LOST_DIRECTION;
}

void gbt_watch_see(gbt_watch *watch, const gbt_forecast *forecast, const gbt_sighting *sighting)
{
    const double began = forecast->time, step = began + gbt_pilot_numbers.forecast_period - began;
    const double place = (sighting->time - began) / step;
    const int reached = began <= sighting->time && sighting->time <= began + gbt_pilot_numbers.forecast_period * GBT_AHEAD;
    gbt_real line[D], bearing[D];
    if (!gbt_is_bearing(sighting) || !reached) return;
    const int index = place < GBT_AHEAD ? (int)place : GBT_AHEAD - 1;
    const gbt_real share = (gbt_real)(place - index);
    for (int k = 0; k < D; k++)
        line[k] = (1 - share) * forecast->mean[index][k] + share * forecast->mean[index + 1][k] - sighting->position[k];
    const gbt_real spread = spread_of(line, forecast->covariance[index]);
    if (!isfinite(spread)) return;
    gbt_unit_of_angles(sighting->value, bearing);
    const gbt_real angle = gbt_acos(gbt_fmin(gbt_fmax(gbt_dot(line, bearing) / gbt_length(line), -1), 1));
    const gbt_real std = gbt_fmax(sighting->stated ? sighting->std[0] : gbt_pilot_numbers.bearing_std, LEAST_ANGLE_STD);
    watch->off[watch->next] = angle * angle > MANY_TIMES * MANY_TIMES * (spread + std * std);
    watch->next = (watch->next + 1) % GBT_WATCHED;
    if (watch->count < GBT_WATCHED) watch->count++;
}

int gbt_watch_lost(const gbt_watch *watch)
{
    int off = 0;
    for (int k = 0; k < watch->count; k++) off += watch->off[k];
    return watch->vague || (watch->count == GBT_WATCHED && 4 * off > GBT_WATCHED);
}
