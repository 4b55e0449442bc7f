/* What measurements make of the Gaussians of the bank: tracking/held/corrections.py in C. */
#ifndef GBT_HELD_CORRECT_H
#define GBT_HELD_CORRECT_H

#include "gbt_held_bank.h"
#include "gbt_polar.h"

GBT_BEGIN_C

/* After a bearing with a variance across the line of sight; returns its squared standardised innovation. */
gbt_real gbt_bank_correct(gbt_component *one, const gbt_real *angles, gbt_real variance);

/* After the position relative to the vehicle was measured, with its covariance. */
void gbt_bank_place(gbt_component *one, const gbt_real *position, const gbt_real *covariance);

/* After a measurement of any kind, so many seconds from now, from a sensor whose place counts from where the vehicle is at
   `origin`; bearing_std is that of angles that do not state theirs. Its density is in units of its deviation. */
void gbt_bank_sight(gbt_component *one, const gbt_sighting *sighting, gbt_real lag, const gbt_real *origin,
                    gbt_real bearing_std);

GBT_END_C

#endif
