/* One step of the planner: from a state and a forecast to a plan that may be executed.

       static gbt_planner planner;       tens of kilobytes: too large for many a stack
       gbt_plan_init(&planner);
       for every period:
           gbt_plan(&planner, state, mean, covariance, desired, &plan);
           follow plan.thrust[0], or the first piece of the trajectory, for one period

   Every call returns a plan, unless the input is not finite, or so large that no plan is (a square above what the
   precision can express: speeds of 1e154, or 1e19 in single precision): then the origin is GBT_NO_PLAN, the status
   GBT_NOT_FINITE, and the planner is as before. Thrust is kept within its limits. Where the other limits
   cannot all be kept, those on what is only believed of the target give before the others, each by as little as the
   thrust allows, and plan.given_up says by how much. Where the solver fails, the answer is what it had when its
   iterations were spent if the first piece of that keeps the limits, the rest of the previous plan, a plan from a cold
   start, what the solver had and then that rest, if their first pieces keep the thrust limits or can be brought within
   them, or a braking plan, in this order. What no solver finished must serve better than braking (gbt_worth.h). Nothing
   is allocated, and the solver's iterations of all attempts together are at most settings.deadline. */
#include "gbt_identity.h"

#ifndef GBT_PLAN_H
#define GBT_PLAN_H

#include "gbt_solver.h"

GBT_BEGIN_C

#define GBT_TIGHTENINGS 4 /* how often limits may be tightened in one attempt */
#define GBT_PROFILE 5     /* points of the thrust profile in every piece, both ends included */

typedef enum {
    GBT_PLANNED = 0,  /* the solver's plan */
    GBT_SHIFTED = 1,  /* the rest of the previous plan */
    GBT_COLD = 2,     /* the solver's plan from a cold start, after a warm one failed */
    GBT_BRAKED = 3,   /* a braking plan */
    GBT_NO_PLAN = 4,  /* the input was not finite, or too large for a plan that is; all numbers are zero */
    GBT_UNFINISHED = 5 /* what the solver had when its iterations were spent */
} gbt_origin;

typedef struct {
    gbt_status status;  /* of the first attempt: GBT_SOLVED, GBT_GIVEN_UP, or why there is another origin */
    gbt_origin origin;
    int iterations;     /* of all attempts */
    int tightened;      /* how often limits were tightened, since the first piece broke them between the nodes */
    gbt_real objective; /* without penalty */
    gbt_real violation; /* of the true limits, on a fine grid of the whole plan, in units of the limits; 0 inside */
    gbt_real piece_violation[GBT_PIECES];
    gbt_real given_up[GBT_LIMITS + 1];        /* worst violation of each limit that had to give, 0 of the others, and */
    gbt_real broken_at_start[GBT_LIMITS + 1]; /* what was broken where the plan begins; in units of the limits, which
                                                 are in the order of gbt_limits and gbt_limit_names */
    gbt_real top[GBT_PIECES][GBT_FREE];       /* what is free in the pieces: with the state, the trajectory */
    gbt_real endpoints[GBT_PIECES][GBT_FLAT]; /* flat output at the end of each piece */
    gbt_real rates[GBT_PIECES][GBT_FLAT];     /* and its rate */
    gbt_real thrust[GBT_PIECES][GBT_PROFILE][GBT_INPUTS];
} gbt_plan_result;

typedef struct {
    gbt_settings settings;
    int warm; /* whether there is a previous plan */
    gbt_real previous[GBT_PIECES][GBT_FREE];
    gbt_real begin[GBT_STATE];   /* where the previous plan began, relative to: */
    double place[GBT_DIMENSION]; /* also what the numbers are relative to */
#if GBT_RELATIVE
    double origin[GBT_DIMENSION]; /* of the coordinates of state, means and endpoints; see gbt_plan_init */
#endif
#if GBT_SHOOTING
    int ready; /* whether gbt_plan_prepare has done its part */
#endif
    gbt_real numbers[GBT_NUMBERS + 1];
    gbt_workspace work;
} gbt_planner;

/* Default settings, no previous plan, the origin zero. Settings may be changed between the steps. planner->origin may be
   set to a place near the vehicle, in the coordinates of zones and depths: state, mean and endpoints are then relative to
   it. Single precision needs that far from zero, since it knows a northing of 7,000 km to half a metre. */
#define gbt_plan_init GBT_NAME(gbt_plan_init)
void gbt_plan_init(gbt_planner *planner);

/* Size of a gbt_planner, for callers that do not see the struct. */
size_t gbt_planner_bytes(void);

#if GBT_MOMENTS
/* Plans from the moments of a forecast. The inputs are read before the plan is written, and may be part of it.

   state        now, GBT_STATE: of a flat vehicle the continuous derivatives of the flat output, itself first
   mean         of the target's position at the endpoints t + T, t + 2 T, ..., GBT_PIECES x GBT_DIMENSION, m; where
                GBT_PRESENT is 1, limits depend on the target, and the mean at t comes first: one row more
   covariance   the same, as many x GBT_DIMENSION x GBT_DIMENSION, m^2
   desired      desired bearings at the endpoints, unit vectors, GBT_PIECES x GBT_DIMENSION */
gbt_status gbt_plan(gbt_planner *planner, const gbt_real *state, const gbt_real *mean, const gbt_real *covariance,
                    const gbt_real *desired, gbt_plan_result *plan);
#endif

/* The same from the parameters of the objective, GBT_PIECES x GBT_PARAMETERS, followed by those of the limits,
   (GBT_PIECES + 1) x GBT_MOVING. Positions among them are those of zones and depths, whatever the origin. */
gbt_status gbt_plan_parameters(gbt_planner *planner, const gbt_real *state, const double *parameters,
                               gbt_plan_result *plan);

#if GBT_SHOOTING
/* A step in two parts, for the least time between state and plan. Between two samples gbt_plan_prepare takes the rest of
   the previous plan, to be over by one piece when the next state comes, with the forecast of then, and computes and
   factorises all derivatives: nearly all of an iteration. Returns GBT_SOLVED, or GBT_NUMERICAL_FAILURE if that cannot be;
   without a previous plan the latter. When the state is there, gbt_plan_feedback makes one Newton step for it and for the
   new forecast and two iterations more, and gives the plan, whether they have converged or not; inputs are cut to what the
   vehicle has. What has not converged and serves no better than braking is answered by braking, its status says why. Where
   nothing is prepared it is gbt_plan. (Diehl, Bock and Schlöder 2005: the real-time iteration.) */
gbt_status gbt_plan_prepare(gbt_planner *planner);
#if GBT_MOMENTS
gbt_status gbt_plan_feedback(gbt_planner *planner, const gbt_real *state, const gbt_real *mean,
                             const gbt_real *covariance, const gbt_real *desired, gbt_plan_result *plan);
#endif
gbt_status gbt_plan_feedback_parameters(gbt_planner *planner, const gbt_real *state, const double *parameters,
                                        gbt_plan_result *plan);
#endif

GBT_END_C

#endif
