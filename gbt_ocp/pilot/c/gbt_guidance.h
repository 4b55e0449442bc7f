/* What the vehicle is to do: cross the line of sight while the range is not known, else follow a plan. PlannedMotion of
   guidance/planned.py and CrossFirst of guidance/startup.py in C. */
#ifndef GBT_GUIDANCE_H
#define GBT_GUIDANCE_H

#include <stddef.h>

#include "gbt_desired.h"
#include "gbt_forecast.h"
#include "gbt_plan.h"
#include "gbt_setpoint.h"
#include "gbt_startup.h"
#if GBT_SHOOTING
#include "gbt_helm.h"
#include "gbt_regulator.h"
#define GBT_JOINED 2 /* derivatives that are known of the first numbers of the state: these and their rates */
#else
#include "gbt_follow.h"
#endif
#include "gbt_tracker.h"

GBT_BEGIN_C

typedef enum {
    GBT_DECIDED_PLAN = 0,     /* a plan was made */
    GBT_DECIDED_FOLLOW = 1,   /* the plan of an earlier step is followed on */
    GBT_DECIDED_CROSS = 2,    /* the thrust crosses the line of sight */
    GBT_DECIDED_NOTHING = 3   /* numbers so large that no plan is finite; nothing was done */
} gbt_decision;

/* The planner, and what the tracker works on in the place of the planner's workspace: they never work at once, and neither
   keeps anything there. */
typedef union {
    gbt_planner planner;
    struct {
        unsigned char kept[offsetof(gbt_planner, work)];
        gbt_tracker_work work;
    } tracking;
} gbt_workroom;

typedef struct {
    gbt_workroom room;
    gbt_plan_result plan;  /* the last one that was made */
#if GBT_SHOOTING
    gbt_regulator regulator; /* has taken it */
    gbt_helm helm;
    gbt_real began[GBT_STATE]; /* where it begins */
    int acts;                  /* whether the inputs that act where the next plan begins are these, and not the plan's */
    gbt_real acting[GBT_INPUTS];
#else
    gbt_follower follower; /* has taken it */
    gbt_thrusters thrusters;
    gbt_disturbance disturbance;
#endif
    gbt_desired desired;
    gbt_startup startup;
    int planned;           /* whether there is a plan to follow on */
    double planned_at;     /* when it was made */
    double elapsed;        /* seconds of it that lay behind at the last decision */
    int legs_begun;
    gbt_real thrust[GBT_INPUTS]; /* that crosses */
} gbt_guidance;

void gbt_guidance_begin(gbt_guidance *guidance);

/* What to do from a time on, from the derivatives of the flat output, GBT_JOINED x GBT_FLAT. */
gbt_decision gbt_guidance_decide(gbt_guidance *guidance, double time, gbt_real flat[GBT_JOINED][GBT_FLAT],
                                 const gbt_forecast *forecast);

/* Has another plan followed, and the next one begin from its rest, in the place of the last one; GBT_PIECES x GBT_FREE. */
void gbt_guidance_replace(gbt_guidance *guidance, const gbt_real *top);

GBT_END_C

#endif
