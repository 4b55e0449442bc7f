/* The tracker of this pilot, under names that do not say which: the Gaussian process on the shape of the motion. */
#ifndef GBT_TRACKER_H
#define GBT_TRACKER_H

#include "gbt_forecast.h"
#include "gbt_sighting.h"

#include "gbt_motion_gp.h"

GBT_BEGIN_C

/* a state, and one before it: what the tracker takes costs more than memory for it */
#define GBT_KEPT_STATES 2

typedef gbt_motion_gp gbt_tracker;
typedef gbt_motion_gp_work gbt_tracker_work; /* keeps nothing from one measurement to the next */
extern const gbt_motion_gp_settings gbt_tracker_settings; /* generated, in gbt_pilot_settings.c */

/* Nothing taken yet, with the vehicle at start, GBT_DIMENSION. */
static inline void gbt_tracker_begin(gbt_tracker *tracker, const gbt_real *start)
{
    gbt_motion_gp_begin(tracker, &gbt_tracker_settings, start);
}

/* Moves the origin of all positions by a way, GBT_DIMENSION. */
static inline void gbt_tracker_shift(gbt_tracker *tracker, const gbt_real *way) { gbt_motion_gp_shift(tracker, way); }

/* Takes a measurement; 0 where it refuses it. */
static inline int gbt_tracker_take(gbt_tracker *tracker, gbt_tracker_work *work, const gbt_sighting *sighting)
{
    return gbt_motion_gp_take(tracker, &gbt_tracker_settings, work, sighting);
}

/* The forecast from a time on. */
static inline void gbt_tracker_predict(gbt_tracker *tracker, gbt_tracker_work *work, double time, gbt_forecast *forecast)
{
    const double period = gbt_pilot_numbers.forecast_period;
    forecast->time = time;
    (void)work;
    for (int k = 0; k <= GBT_AHEAD; k++)
        gbt_motion_gp_predict(tracker, &gbt_tracker_settings, time + period * k, forecast->mean[k],
                              forecast->covariance[k][0]);
}

/* How often a new track has begun after a gap. */
static inline int gbt_new_tracks(const gbt_tracker *tracker) { return tracker->gaps.count; }

GBT_END_C

#endif
