/* Where the vehicle was: own poses by time, interpolated between navigations: pilot/own_track.py in C. */
#ifndef GBT_OWN_TRACK_H
#define GBT_OWN_TRACK_H

#include "gbt_pilot_settings.h"
#include "gbt_problem.h"

GBT_BEGIN_C

/* Position and yaw; of some vehicles the pitch too, bow up. */
#define GBT_POSE (GBT_FLAT > GBT_DIMENSION + 1 ? GBT_FLAT : GBT_DIMENSION + 1)

/* What became of something that a pilot was given. */
typedef enum {
    GBT_TAKEN = 0,
    GBT_LATE = 1,          /* sorted in before others */
    GBT_WAITING = 2,       /* a measurement, for a navigation that is not older */
    GBT_DUPLICATE = 3,     /* there is one of that time; of a measurement, of that sensor and kind too */
    GBT_TOO_OLD = 4,       /* by more than gbt_pilot_numbers.late */
    GBT_AHEAD_OF_ALL = 5,  /* of all else, by more than a gap; a navigation then waits for one that confirms it */
    GBT_NO_NUMBER = 6,     /* an input is not finite, a pose or velocity beyond 1e12 in size, or a variance below 0 */
    GBT_NO_NAVIGATION = 7, /* at the time of the measurement */
    GBT_REFUSED = 8,       /* by the tracker, at the next command */
    GBT_FULL = 9,          /* GBT_MEASUREMENTS wait for the next command already */
    GBT_WRONG = 10         /* no kind, frame or sensor there is, or a deviation that is not above 0 */
} gbt_received;

#define GBT_ANSWERS 11

typedef struct {
    double time;
    gbt_real pose[GBT_POSE];  /* earth frame, m and rad */
    gbt_real rates[GBT_POSE]; /* their time derivative, earth frame */
    gbt_real heading_std;     /* rad */
} gbt_own_state;

typedef struct {
    int count, doubted; /* states, and whether there is one that is ahead of all else */
    gbt_own_state doubtful;
    gbt_own_state state[GBT_NAVIGATIONS]; /* in the order of time; the oldest are forgotten */
} gbt_own_track;

/* The rates of a pose of a velocity in the body frame and the rates of the angles. */
void gbt_earth_rates(const gbt_real *pose, const gbt_real *velocity, gbt_real *rates);

/* Sorts a state in, whose numbers are finite; now is the latest time at which a command was asked for. */
gbt_received gbt_own_add(gbt_own_track *track, const gbt_own_state *state, double now);

/* Whether navigation has come as far as a time. */
int gbt_own_covers(const gbt_own_track *track, double time);

/* The state at a time; 0 before the first one, and in a gap that is not to be bridged. */
int gbt_own_at(const gbt_own_track *track, double time, int bridging, gbt_own_state *state);

GBT_END_C

#endif
