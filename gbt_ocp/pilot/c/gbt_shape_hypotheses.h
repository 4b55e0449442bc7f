/* The distinct motions that fit the bearings, and the moments of their mixture: tracking/shape/hypotheses.py and moments.py
   in C. Motions of one hypothesis stand together, one for each point of the grid. */
#ifndef GBT_SHAPE_HYPOTHESES_H
#define GBT_SHAPE_HYPOTHESES_H

#include "gbt_motion_gp.h"

GBT_BEGIN_C

/* Lets starts at several ranges compete with the first `hypotheses` in the workspace, which are fitted: fits what is new
   and as likely under all points of the grid, and returns how many hypotheses there are then. */
int gbt_hypotheses_compete(const gbt_motion_gp_settings *settings, gbt_motion_gp_work *work, int hypotheses);

/* Leaves the likeliest hypotheses, at most GBT_HYPOTHESES, without those that are the same motion as a likelier one. */
int gbt_hypotheses_distinct(const gbt_motion_gp_settings *settings, gbt_motion_gp_work *work, int hypotheses);

/* What the hypotheses in the workspace say: their weights, and moments now, ahead and a node behind. */
void gbt_hypotheses_moments(gbt_motion_gp *process, const gbt_motion_gp_settings *settings, gbt_motion_gp_work *work);

GBT_END_C

#endif
