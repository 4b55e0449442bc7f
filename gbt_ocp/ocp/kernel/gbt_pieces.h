/* The flat form of a trajectory, piece by piece. A piece is described by the derivatives 0 .. L of the flat output at its
   beginning; the first GBT_JOINED of them follow from the piece before, the others are free. */
#ifndef GBT_PIECES_H
#define GBT_PIECES_H

#include "gbt_form.h"

GBT_BEGIN_C

/* power[k] = s^k / k!: how much of derivative o + k at the beginning is in derivative o after s seconds. */
void gbt_taylor(gbt_real s, gbt_real power[GBT_ORDERS]);

/* z, its rate and its acceleration after s seconds of a piece. */
void gbt_point_after(gbt_piece piece, gbt_real s, gbt_real *point);

/* Sets the lowest free derivative of a piece so that derivative `first` of the flat output becomes `aim`, and those above
   it zero, in as few pieces as there are inherited ones of them; what is free above it is not touched. */
void gbt_settle(gbt_piece piece, int first, const gbt_real *aim);

GBT_END_C

#endif
