/* Measurements of trackers of bins, and those that wait for bearings. */
#ifndef GBT_WAITING_H
#define GBT_WAITING_H

#include "gbt_bins.h"
#include "gbt_singles.h"

GBT_BEGIN_C

typedef struct {
    double latest; /* time of the latest measurement, s; minus infinity before the first */
    int full;      /* whether the newest bin has been taken in, or there is none */
    int count;     /* of those that wait, the oldest first */
    gbt_sighting sighting[GBT_OTHERS];
} gbt_waiting;

/* Nothing waits, and no measurement has come; those that will come may have any time. */
void gbt_waiting_begin(gbt_waiting *waiting);

/* Forgets those that wait. */
void gbt_waiting_clear(gbt_waiting *waiting);

/* Moves the origin of all positions by a way, GBT_DIMENSION. */
void gbt_waiting_shift(gbt_waiting *waiting, const gbt_real *way);

/* Forgets those that are of another bin than a time. */
void gbt_waiting_forget(gbt_waiting *waiting, double width, double time);

/* Whether there is room for one of a time. */
int gbt_waiting_room(const gbt_waiting *waiting, double width, double time);

/* Adds one for which there is room. */
void gbt_waiting_add(gbt_waiting *waiting, const gbt_sighting *sighting);

/* Takes a measurement apart where it can be taken at or after a time, and its bearing into these bins; 0 where it cannot. A
   bearing that does not state its deviation has to be later than the last one. */
int gbt_take_apart(const gbt_sighting *sighting, double latest, const gbt_bins *bins, const gbt_binning *binning,
                   gbt_real bearing_std, gbt_sighting_parts *parts);

/* How many ordinary bearings the bearing among the parts is worth. */
gbt_real gbt_worth(const gbt_sighting_parts *parts, gbt_real bearing_std);

GBT_END_C

#endif
