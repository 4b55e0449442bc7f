/* What a plan is worth, and what follows from it: beside braking of one that no solver finished, and all else of one that is
   followed. */
#ifndef GBT_WORTH_H
#define GBT_WORTH_H

#include "gbt_plan.h"

GBT_BEGIN_C

/* Whether a plan is finite and serves better than the braking plan from the same start. It does not where it breaks the
   judged limits by a whole unit more, or by no less while it gains less: a plan by integration of a vehicle that is
   broadside at speed may leave for infinity, and so may the rest of one of high degree.

   start        the state where it begins, GBT_STATE
   top          what is free in its pieces, GBT_PIECES x GBT_FREE, not scaled
   parameters   as of gbt_solve */
int gbt_beats_braking(const gbt_real *start, const gbt_real *top, const gbt_real *parameters);

/* Endpoints, rates, inputs and objective of plan->top from a state. */
void gbt_fill_plan(const gbt_real *state, const gbt_real *parameters, gbt_plan_result *plan);

GBT_END_C

#endif
