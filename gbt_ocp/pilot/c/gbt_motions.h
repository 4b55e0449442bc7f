/* The shape of a motion as a Gaussian process: tracking/shape/processes.py, motions.py and course.py in C.

   Turn rate, change of log speed and in space change of climb angle are processes at knots of time, products of a factor of
   their covariance and whitened coordinates. The coordinates of a motion are: log range, direction, log speed, heading, in
   space climb angle; then those of the knots, from now into the past: that of the turn rate now, and for each slow knot
   those of two of the turn rate, of log speed and in space of climb angle. What a motion does between now and a time so
   depends on the first of them only. */
#ifndef GBT_MOTIONS_H
#define GBT_MOTIONS_H

#include "gbt_bearing.h"
#include "gbt_linalg.h"
#include "gbt_pilot_settings.h"

GBT_BEGIN_C

#define GBT_SLOWER 2    /* knots of the turn rate per knot of log speed and climb angle */
#define GBT_KNOT_NODES 2 /* nodes of the integration per knot of the turn rate */
#define GBT_FAST (GBT_SLOWER * GBT_SLOW + 1)                   /* knots of the turn rate, from now into the past */
#define GBT_FAST_ALL (GBT_FAST + GBT_SLOWER * GBT_BLOCKS)      /* and those ahead */
#define GBT_SLOW_ALL (GBT_SLOW + GBT_BLOCKS)                   /* the same of log speed, without that of now */
#define GBT_HEADS (2 * GBT_DIMENSION)                          /* 4 in the plane, 6 in space */
#define GBT_EACH (GBT_SLOWER + GBT_AXES)                       /* coordinates of a slow knot */
#define GBT_COORDINATES (GBT_HEADS + 1 + GBT_SLOW * GBT_EACH)
#define GBT_SPEED_AT GBT_DIMENSION
#define GBT_HEADING_AT (GBT_DIMENSION + 1)
#define GBT_CLIMB_AT (GBT_DIMENSION + 2)
#define GBT_NODES_OF(slow) (GBT_SLOWER * GBT_KNOT_NODES * (slow) + 1)
#define GBT_NODES_PAST GBT_NODES_OF(GBT_SLOW)
#define GBT_NODES_AHEAD GBT_NODES_OF(GBT_BLOCKS)
#define GBT_POINTS (GBT_TURN_STDS * GBT_TURN_TIMES * GBT_SPEED_STDS) /* of the grid, the speed's deviation running first */
#define GBT_FLAT_ANGLE ((gbt_real)1.8137993642342178) /* deviation of an angle of which nothing is known: pi / sqrt(3) */

typedef struct {
    double knot, span;                            /* between knots of the turn rate, and how far back all of them reach, s */
    gbt_real speed, log_speed_std, range, log_range_std; /* medians in m/s and m, and deviations of the logarithms */
    gbt_real climb_std, climb_change_std;         /* of the climb angle and its change, rad; not read in the plane */
    gbt_real turn_std[GBT_TURN_STDS], speed_std[GBT_SPEED_STDS]; /* the grid: rad/s, and of the change of log speed */
    /* lower triangles, row by row: factors of the covariances of the knots, of deviation 1, the past first */
    gbt_real turn_factor[GBT_TURN_TIMES][GBT_ROW_BEGIN(GBT_FAST_ALL)];
    gbt_real speed_factor[GBT_ROW_BEGIN(GBT_SLOW_ALL)], climb_factor[GBT_ROW_BEGIN(GBT_SLOW_ALL)];
} gbt_shape_prior;

typedef struct {
    int point;                         /* of the grid */
    gbt_real heading;                  /* now, rad */
    gbt_real direction[GBT_DIMENSION]; /* unit vector from the own position now to the target now */
    gbt_real white[GBT_COORDINATES];   /* zero where direction and heading are centred on these */
} gbt_motion;

/* A motion, node by node from now into the past or ahead, where its coordinates are zero, their mean. */
typedef struct {
    int ahead, node;
    gbt_real step; /* between nodes, s; below 0 into the past */
    gbt_real rate[GBT_FAST_ALL], faster[GBT_SLOW_ALL + 1], steeper[GBT_SLOW_ALL + 1]; /* at knots, now first */
    gbt_real turned, pace, speed; /* change of the heading; log speed over the median's; m/s */
    gbt_real velocity[GBT_DIMENSION], raised[GBT_DIMENSION]; /* and its slope by the climb angle */
    gbt_real position[GBT_DIMENSION]; /* relative to the own position now, m */
} gbt_course;

#define GBT_BEYOND (GBT_BLOCKS * GBT_EACH) /* coordinates of the future */

/* Slopes of the position by the coordinates along a course; those of the future stand behind the others. */
typedef struct {
    int active;   /* coordinates from which on all is zero, of those of the past */
    gbt_real turn[GBT_FAST_ALL], row[GBT_FAST_ALL]; /* of the heading's change and the turn rate by their coordinates */
    gbt_real rates[GBT_DIMENSION][GBT_COORDINATES + GBT_BEYOND];  /* of the velocity */
    gbt_real before[GBT_DIMENSION][GBT_COORDINATES + GBT_BEYOND]; /* of the position at the node before */
    gbt_real here[GBT_DIMENSION][GBT_COORDINATES + GBT_BEYOND];   /* and at this one */
} gbt_slopes;

/* How many seconds ahead of now motions are computed. */
double gbt_longest_ahead(const gbt_shape_prior *prior);

/* The first node, now; slopes may be 0. */
void gbt_course_begin(gbt_course *course, gbt_slopes *slopes, const gbt_shape_prior *prior, const gbt_motion *motion,
                      int ahead);

/* The next one. */
void gbt_course_next(gbt_course *course, gbt_slopes *slopes, const gbt_shape_prior *prior, const gbt_motion *motion);

/* A straight motion at a range in a direction with a velocity, under a point of the grid. */
void gbt_motion_begin(const gbt_shape_prior *prior, int point, gbt_real range, const gbt_real *direction,
                      const gbt_real *velocity, gbt_motion *motion);

/* A motion after a step in its coordinates. */
void gbt_motion_move(const gbt_motion *motion, const gbt_real *step, gbt_motion *moved);

/* The same motion seen `seconds` later, and from an own position that has moved by `own`. */
void gbt_motion_advance(const gbt_shape_prior *prior, const gbt_motion *motion, double seconds, const gbt_real *own,
                        gbt_motion *later);

/* The same motion under another point of the grid. */
void gbt_motion_transfer(const gbt_shape_prior *prior, const gbt_motion *motion, int point, gbt_motion *other);

GBT_END_C

#endif
