/* The follower: thrust that keeps the vehicle on its plan between two plans.

       gbt_follower follower;
       gbt_follow_init(&follower, bandwidth);
       after every gbt_plan:
           gbt_follow_plan(&follower, state, plan.top[0]);
       at every sample, at 50 Hz or faster:
           gbt_follow(&follower, elapsed, hold, z, dz, &command);
           gbt_thrusters_ask(&thrusters, passed, hold, command.thrust);   where their lag is known
           apply command.thrust until the next sample
   or, for a vehicle with an autopilot of its own:
       gbt_follow_setpoint(&follower, elapsed + lag, 0, &setpoint);
       hand on its course, speed, heading and depth

   Computed torque on the flat output: the thrust of the acceleration  ddz + 2 w (dz - dz_m) + w^2 (z - z_m)  at the
   measured z_m and its rate dz_m. Without model error and within the limits the error e of each flat output then obeys
   e'' + 2 w e' + w^2 e = 0. Of an angle w is four times the bandwidth, up to 8 rad/s if that is more: what is not known
   of the Munk moment turns a vehicle faster than it takes it off its course. Where turning takes more than 0.7 of an
   input, and more than planned, the vehicle is slowed down for it. */
#ifndef GBT_FOLLOW_H
#define GBT_FOLLOW_H

#include "gbt_setpoint.h"
#include "gbt_solver.h"

GBT_BEGIN_C

typedef struct {
    gbt_real bandwidth; /* w of the position in rad/s */
    int planned;        /* whether there is a plan */
    gbt_real start[GBT_JOINED][GBT_FLAT], top[GBT_PIECES][GBT_FREE];
} gbt_follower;

typedef struct {
    gbt_follow_status status;
    gbt_real thrust[GBT_INPUTS]; /* within the limits */
    gbt_real error[GBT_FLAT];    /* plan less measurement; of an angle, the short way round */
    gbt_real off_plan;           /* distance of the position from the plan, m */
} gbt_follow_result;

/* Thrusters of first order, of which the lag is known: dT/dt = (asked - T) / lag. */
typedef struct {
    gbt_real lag;                 /* s */
    gbt_real asked[GBT_INPUTS];   /* at the last call, */
    gbt_real acting[GBT_INPUTS];  /* and what acted then */
} gbt_thrusters;

/* At rest; with a lag of 0 what is wanted is asked. */
void gbt_thrusters_init(gbt_thrusters *thrusters, gbt_real lag);

/* What to ask until the next sample, in the place of the thrust that is wanted: more, so that it acts after a tenth of the
   lag, or at the next sample if that is later.

   passed   seconds since the last call
   hold     seconds until the next sample */
void gbt_thrusters_ask(gbt_thrusters *thrusters, gbt_real passed, gbt_real hold, gbt_real *thrust);

/* Mean thrust over so many seconds since the last call of that. */
void gbt_thrusters_acted(const gbt_thrusters *thrusters, gbt_real passed, gbt_real *acted);

/* What the vehicle needs of thrust beyond its model: of the thrust that acted between two samples, what the motion did not
   need. A follower adds it. */
typedef struct {
    int known; /* whether there is a sample before, with */
    gbt_real z[GBT_FLAT], dz[GBT_FLAT];
    gbt_real estimate[GBT_INPUTS];
} gbt_disturbance;

void gbt_disturbance_init(gbt_disturbance *disturbance);

/* Low-passes what acted beyond the model.

   z, dz    measured flat output and its rate through the water, GBT_FLAT each
   acted    mean thrust since the last sample, GBT_INPUTS
   passed   seconds since then */
void gbt_disturbance_observe(gbt_disturbance *disturbance, const gbt_real *z, const gbt_real *dz, const gbt_real *acted,
                             gbt_real passed);

/* No plan yet. */
void gbt_follow_init(gbt_follower *follower, gbt_real bandwidth);

/* Takes a plan: the state from which it was made, GBT_JOINED x GBT_FLAT, and what is free in its pieces,
   GBT_PIECES x GBT_FREE. */
void gbt_follow_plan(gbt_follower *follower, const gbt_real *state, const gbt_real *top);

/* The thrust until the next sample. It is evaluated for the middle of that time: until then the vehicle is taken to move
   as planned.

   elapsed   seconds since the plan was made
   hold      seconds until the next sample
   z, dz     measured flat output and its rate, GBT_FLAT each */
gbt_follow_status gbt_follow(const gbt_follower *follower, gbt_real elapsed, gbt_real hold, const gbt_real *z,
                             const gbt_real *dz, gbt_follow_result *result);

/* The same from points of a plan, z, its rate and its acceleration, GBT_POINT each, for a caller that has them.

   bandwidth     w in rad/s
   now, middle   points of the plan now, and in the middle of the time until the next sample
   own           measured flat output in the coordinates of these points, GBT_FLAT
   z, dz         measured flat output and its rate, GBT_FLAT each
   beyond        thrust that is added for what the vehicle needs beyond its model, GBT_INPUTS; 0 for none */
gbt_follow_status gbt_follow_points(gbt_real bandwidth, const gbt_real *now, const gbt_real *middle, const gbt_real *own,
                                    const gbt_real *z, const gbt_real *dz, const gbt_real *beyond,
                                    gbt_follow_result *result);

/* What an autopilot is given in place of thrust: where the plan is, and how it moves there. Beyond the end of the plan
   that is its end.

   ahead   seconds since the plan was made: those elapsed, and about the lag of the autopilot
   water   velocity of the water over ground, GBT_DIMENSION, in whose frame the plan was made; 0 for still water */
gbt_follow_status gbt_follow_setpoint(const gbt_follower *follower, gbt_real ahead, const gbt_real *water,
                                      gbt_setpoint *setpoint);

GBT_END_C

#endif
