/* The first moves: until the range is known the vehicle crosses the line of sight, and nothing is planned.

       gbt_startup startup;
       gbt_startup_init(&startup, axis, deviation, speed, opening, leg, nearest, period);
       at every step:
           switch (gbt_startup_step(&startup, time, z, dz, mean, covariance, thrust)) {
           case GBT_STARTUP_CROSS:    apply thrust until the next step
           case GBT_STARTUP_RESTART:  planner.warm = 0;    then as below
           case GBT_STARTUP_PLAN:     gbt_plan(&planner, ...) */
#ifndef GBT_STARTUP_H
#define GBT_STARTUP_H

#include "gbt_solver.h"

GBT_BEGIN_C

typedef enum {
    GBT_STARTUP_PLAN = 0,      /* the range is known */
    GBT_STARTUP_RESTART = 1,   /* the same, for the first time after crossing: an earlier plan is to be forgotten */
    GBT_STARTUP_CROSS = 2,     /* the range is not known */
    GBT_STARTUP_NOT_FINITE = 3 /* an input is not finite; no thrust, nothing else was done */
} gbt_startup_status;

typedef struct {
    /* settings */
    gbt_real axis[3];   /* of the turn of the desired bearing in space, a unit vector */
    gbt_real deviation; /* posterior deviation of the range over the range below which it counts as known */
    gbt_real speed;     /* m/s */
    gbt_real opening;   /* part of it that leads away from the target, m/s */
    gbt_real leg;       /* time after which the vehicle crosses the other way, s */
    gbt_real nearest;   /* distance to be kept, as far as the range is known, m; 0 for none */
    gbt_real period;    /* time within which a velocity is reached, s */
    /* what is remembered */
    int known;      /* whether the range was known at the last step */
    int crossing;   /* whether the vehicle crossed at the last step */
    gbt_real began; /* time at which it began to, if so */
} gbt_startup;

/* Nothing remembered.

   axis        of the turn of the desired bearing, 3 numbers that are not all 0; in the plane it is not read
   deviation   posterior deviation of the range over the range below which it counts as known
   speed       of the vehicle, m/s
   opening     part of the speed that leads away from the target, m/s, less than the speed
   leg         time after which the vehicle crosses the other way, s
   nearest     distance to be kept, as far as the range is known, m; 0 for none
   period      time within which a velocity is reached, s: that between two steps */
void gbt_startup_init(gbt_startup *startup, const gbt_real *axis, gbt_real deviation, gbt_real speed, gbt_real opening,
                      gbt_real leg, gbt_real nearest, gbt_real period);

/* One step for any vehicle: how fast to cross.

   time         now, s
   z            measured position first, GBT_DIMENSION, m
   mean         posterior mean of the target's position now, GBT_DIMENSION, m
   covariance   its covariance, GBT_DIMENSION x GBT_DIMENSION, m^2
   velocity     GBT_DIMENSION, m/s; 0 unless the vehicle is to cross */
gbt_startup_status gbt_startup_velocity(gbt_startup *startup, gbt_real time, const gbt_real *z, const gbt_real *mean,
                                        const gbt_real *covariance, gbt_real *velocity);

#if !GBT_SHOOTING
/* The same for a flat vehicle, with the thrust that crosses.

   time         now, s
   z, dz        measured flat output and its rate, GBT_FLAT each
   mean         posterior mean of the target's position now, GBT_DIMENSION, m
   covariance   its covariance, GBT_DIMENSION x GBT_DIMENSION, m^2
   thrust       GBT_INPUTS, within the limits; 0 unless the vehicle is to cross */
gbt_startup_status gbt_startup_step(gbt_startup *startup, gbt_real time, const gbt_real *z, const gbt_real *dz,
                                    const gbt_real *mean, const gbt_real *covariance, gbt_real *thrust);
#endif

GBT_END_C

#endif
