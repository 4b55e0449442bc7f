/* The components that are kept, their weights, and what they say of now and ahead: the rest of tracking/held/held_turn.py in C. */
#ifndef GBT_HELD_KEPT_H
#define GBT_HELD_KEPT_H

#include "gbt_held_turn.h"

GBT_BEGIN_C

/* A component by its number: those that are kept, then those that draw again. */
gbt_component *gbt_held_at(gbt_held_turn *tracker, gbt_held_turn_work *work, int slot);

/* Probabilities of so many components, from slot 0 on and from GBT_COMPONENTS on. */
void gbt_held_weigh(gbt_held_turn *tracker, gbt_held_turn_work *work, int again);

/* Keeps the likeliest components, at most so many, with more than a least weight, in the order of their weights. */
void gbt_held_keep_likeliest(gbt_held_turn *tracker, gbt_held_turn_work *work, int again, int most, gbt_real least);

/* Whether components are reported at the median range: where the deviation of the log range, of which the sum of weights, the
   weighed mean and the weighed mean square are given, is large. */
int gbt_held_at_median(gbt_real total, gbt_real mean, gbt_real square);

/* Whether the components that are kept tell the range to a quarter. */
int gbt_held_observable(const gbt_held_turn *tracker, const gbt_held_turn_work *work);

/* What is known of now and ahead, of the components that are kept. */
void gbt_held_look_ahead(gbt_held_turn *tracker, const gbt_held_turn_settings *settings, gbt_held_turn_work *work);

GBT_END_C

#endif
