/* The last resort: slow down within the limits, without any solver. */
#ifndef GBT_BRAKING_H
#define GBT_BRAKING_H

#include "gbt_solver.h"

GBT_BEGIN_C

/* What is free in the pieces of a braking trajectory, GBT_PIECES x GBT_FREE. Each piece takes, of a family of accelerations that
   runs from drifting (no thrust) to stopping within the piece, the one that ends slowest within the limits; if none
   keeps them, the one that breaks them least. moving: of the limits, (GBT_PIECES + 1) x GBT_MOVING. */
void gbt_brake(const gbt_real *start, const gbt_real *moving, gbt_real *top);

GBT_END_C

#endif
