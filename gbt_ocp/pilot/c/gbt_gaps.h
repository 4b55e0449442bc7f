/* Gaps between measurements after which a track begins again: tracking/gaps.py in C. */
#ifndef GBT_GAPS_H
#define GBT_GAPS_H

#include "gbt_real.h"

GBT_BEGIN_C

typedef struct {
    int count;            /* long gaps that have ended */
    double span;          /* window in seconds; 0 where it is a number of measurements */
    double measurements;  /* window as a number of them */
    double unknown;       /* longest gap before their mean interval is known */
    double began, latest; /* times of the first and the last measurement of the track */
    int taken;            /* measurements of the track */
} gbt_gaps;

/* span in seconds, or 0 for a window of so many measurements. */
void gbt_gaps_init(gbt_gaps *gaps, double span, double measurements);

/* Notes a measurement; whether it ends a long gap, so that it is the first of a new track. */
int gbt_gap_ended(gbt_gaps *gaps, double time);

GBT_END_C

#endif
