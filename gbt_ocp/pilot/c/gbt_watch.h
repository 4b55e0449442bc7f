/* Compares bearings with what was forecast of them: TrackWatch of pilot/pilot_health.py in C. */
#ifndef GBT_WATCH_H
#define GBT_WATCH_H

#include "gbt_forecast.h"
#include "gbt_sighting.h"

GBT_BEGIN_C

#define GBT_WATCHED 20 /* bearings that are remembered */

typedef struct {
    int count, next, off[GBT_WATCHED]; /* whether each of the last bearings was off */
    int vague;                         /* whether the direction to the target is not known */
} gbt_watch;

/* Takes note of a forecast that was made at an own position. */
void gbt_watch_forecast(gbt_watch *watch, const gbt_forecast *forecast, const gbt_real *own);

/* Compares a bearing with the last forecast; other kinds, and times that it does not reach, say nothing. */
void gbt_watch_see(gbt_watch *watch, const gbt_forecast *forecast, const gbt_sighting *sighting);

/* Whether the track is lost. */
int gbt_watch_lost(const gbt_watch *watch);

GBT_END_C

#endif
