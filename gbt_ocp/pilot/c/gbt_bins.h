/* Bearings gathered in bins of a second or two: tracking/bins.py in C. Of the newest bin all samples are kept, of the others
   what a mean and a scatter need. */
#ifndef GBT_BINS_H
#define GBT_BINS_H

#include "gbt_bearing.h"
#include "gbt_pilot_settings.h"

GBT_BEGIN_C

typedef struct {
    double width, window; /* of a bin, and of all of them, s */
    gbt_real stray;       /* angle from the median of its bin beyond which a bearing is left out, rad; may be infinite */
} gbt_binning;

typedef struct {
    double time;
    gbt_real bearing[GBT_DIMENSION], own[GBT_DIMENSION];
    gbt_real offset[GBT_AXES]; /* angle from where the target was expected */
    gbt_real weight;           /* number of ordinary bearings that it is worth */
    int suspect;               /* whether a gate suspects it */
} gbt_binned;

typedef struct {
    double index; /* it begins at index * width */
    double time;  /* means of the bearings that count */
    gbt_real bearing[GBT_DIMENSION], own[GBT_DIMENSION], count;
    gbt_real squares, freedom; /* squared residuals about a straight line in time, and their degrees of freedom */
} gbt_bin;

typedef struct {
    double latest; /* time of the last sample; minus infinity before the first */
    int samples;   /* of the newest bin */
    int count;     /* bins, the oldest first */
    gbt_bin bin[GBT_BINS];
    gbt_binned sample[GBT_BIN_SAMPLES];
} gbt_bins;

/* No bins; later times still have to be after the latest. */
void gbt_bins_clear(gbt_bins *bins);

/* Whether there is no room for a bearing of this time. */
int gbt_bins_full(const gbt_bins *bins, const gbt_binning *binning, double time);

/* Whether a bearing can be added: it is later than the last one, and there is room. */
int gbt_bins_can_add(const gbt_bins *bins, const gbt_binning *binning, double time);

/* Whether a bearing of this time is no longer of the newest bin, which is full then. */
int gbt_bins_filled_by(const gbt_bins *bins, const gbt_binning *binning, double time);

/* Moves the origin of all positions by a way, GBT_DIMENSION. */
void gbt_bins_shift(gbt_bins *bins, const gbt_real *way);

/* Adds a bearing for which there is room; expected may be 0 and is then the first bearing of the bin. */
void gbt_bins_add(gbt_bins *bins, const gbt_binning *binning, double time, const gbt_real *bearing, const gbt_real *own,
                  const gbt_real *expected, int suspect, gbt_real weight);

/* Forgets bins that ended before a time, but for the newest. */
void gbt_bins_forget(gbt_bins *bins, const gbt_binning *binning, double time);

/* When the oldest bin begins; not of none. */
double gbt_bins_begin(const gbt_bins *bins, const gbt_binning *binning);

GBT_END_C

#endif
