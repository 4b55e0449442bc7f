#include "gbt_gaps.h"

#include "gbt_math.h"

#define WINDOWS 10.0            /* windows that a gap may last before the track begins again */
#define ENOUGH_INTERVALS 10     /* intervals from whose mean the length of a window is known */
#define LONGEST_UNKNOWN 3600.0  /* longest gap before that */

void gbt_gaps_init(gbt_gaps *gaps, double span, double measurements)
{
    gaps->count = gaps->taken = 0;
    gaps->span = span;
    gaps->measurements = measurements;
    gaps->unknown = LONGEST_UNKNOWN;
    gaps->began = gaps->latest = 0;
}

static double longest(const gbt_gaps *gaps)
{
    if (gaps->span > 0) return WINDOWS * gaps->span;
    if (gaps->taken <= ENOUGH_INTERVALS) return gaps->unknown;
    return WINDOWS * gaps->measurements * (gaps->latest - gaps->began) / (double)(gaps->taken - 1);
}

int gbt_gap_ended(gbt_gaps *gaps, double time)
{
    const int ended = gaps->taken > 0 && time - gaps->latest > longest(gaps);
    if (ended) {
        gaps->count++;
        /* measurements may come once a day: only the first such interval is taken for a gap */
        if (gaps->taken <= ENOUGH_INTERVALS)
            gaps->unknown = WINDOWS * gaps->measurements * (time - gaps->latest);
        gaps->taken = 0;
    }
    if (gaps->taken == 0) gaps->began = time;
    gaps->latest = time;
    gaps->taken++;
    return ended;
}
