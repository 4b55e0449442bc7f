/* A plan at any time: ocp/trajectory.py in C, on the plan that a follower has taken. */
#ifndef GBT_TRAJECTORY_H
#define GBT_TRAJECTORY_H

#include "gbt_follow.h"

GBT_BEGIN_C

/* Derivatives 0 .. of the flat output after so many seconds of the plan, positions relative to where it begins. At a
   boundary the later piece counts; beyond both ends the first and the last piece are continued. */
void gbt_trajectory_at(const gbt_follower *plan, double seconds, gbt_real derivatives[GBT_ORDERS][GBT_FLAT]);

GBT_END_C

#endif
