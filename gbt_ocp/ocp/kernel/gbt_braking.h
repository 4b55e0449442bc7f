/* The last resort: slow down within the thrust, by a few projections and without any solver. */
#ifndef GBT_BRAKING_H
#define GBT_BRAKING_H

#include "gbt_solver.h"

GBT_BEGIN_C

/* What is free in the pieces of a braking trajectory, GBT_PIECES x GBT_FREE; limits besides those of the thrust are not
   looked at. A piece starts from the acceleration that stops within it. Wherever the thrust of that exceeds its limits,
   the acceleration is moved by what the excess of thrust accelerates, point by point along the piece and again until no
   point exceeds any more. Where a bounded number of rounds does not end that, drifting is the second start, and the
   piece that breaks the limits less is taken, of two that keep them the one that ends slower. */
void gbt_brake(const gbt_real *start, gbt_real *top);

GBT_END_C

#endif
