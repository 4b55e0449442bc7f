/* Numbers of twice the precision of float, where gbt_real is float: the sum of two, by error-free additions and fused
   multiply-add (Dekker 1971; Joldes, Muller and Popescu 2017), since calls of a library for double are slower. Covariances of
   a smooth motion have conditions of 1e10, which float alone cannot hold. Where gbt_real is double, they are double. */
#ifndef GBT_WIDE_H
#define GBT_WIDE_H

#include <stdint.h>

#include "gbt_math.h"

GBT_BEGIN_C

#ifdef GBT_SINGLE

typedef struct {
    gbt_real high, low; /* low is at most half the last digit of high */
} gbt_wide;

static inline gbt_wide gbt_widen(gbt_real a)
{
    const gbt_wide wide = {a, 0};
    return wide;
}

static inline gbt_real gbt_narrow(gbt_wide a) { return a.high; }

/* A double, without arithmetic in double that a processor may not have. */
static inline gbt_wide gbt_widen_double(double a)
{
    const gbt_real high = (gbt_real)a;
    const gbt_wide wide = {high, (gbt_real)(a - (double)high)};
    return wide;
}

/* The sum of two numbers, the larger first, and of any two, without error. */
static inline gbt_wide gbt_sum_of_ordered(gbt_real a, gbt_real b)
{
    const gbt_real sum = a + b;
    const gbt_wide wide = {sum, b - (sum - a)};
    return wide;
}

static inline gbt_wide gbt_sum_of(gbt_real a, gbt_real b)
{
    const gbt_real sum = a + b, part = sum - a;
    const gbt_wide wide = {sum, (a - (sum - part)) + (b - part)};
    return wide;
}

static inline gbt_wide gbt_plus(gbt_wide a, gbt_wide b)
{
    const gbt_wide sum = gbt_sum_of(a.high, b.high);
    return gbt_sum_of_ordered(sum.high, sum.low + (a.low + b.low));
}

static inline gbt_wide gbt_times(gbt_wide a, gbt_wide b)
{
    const gbt_real product = a.high * b.high, rest = fmaf(a.high, b.high, -product);
    return gbt_sum_of_ordered(product, fmaf(a.high, b.low, fmaf(a.low, b.high, rest)));
}

static inline gbt_wide gbt_negative(gbt_wide a)
{
    const gbt_wide wide = {-a.high, -a.low};
    return wide;
}

static inline gbt_wide gbt_over(gbt_wide a, gbt_wide b)
{
    const gbt_real first = a.high / b.high;
    const gbt_wide rest = gbt_plus(a, gbt_negative(gbt_times(gbt_widen(first), b)));
    return gbt_sum_of_ordered(first, rest.high / b.high);
}

/* The square root of a number above 0. */
static inline gbt_wide gbt_root(gbt_wide a)
{
    const gbt_real first = gbt_sqrt(a.high);
    const gbt_wide rest = gbt_plus(a, gbt_negative(gbt_times(gbt_widen(first), gbt_widen(first))));
    return gbt_sum_of_ordered(first, rest.high / (2 * first));
}

/* c + a b, in one go: what is less than the last digit of the product need not be brought in order by itself. */
static inline gbt_wide gbt_more(gbt_wide c, gbt_wide a, gbt_wide b)
{
    const gbt_real product = a.high * b.high, rest = fmaf(a.high, b.high, -product);
    const gbt_wide sum = gbt_sum_of(c.high, product);
    return gbt_sum_of_ordered(sum.high, sum.low + (c.low + fmaf(a.high, b.low, fmaf(a.low, b.high, rest))));
}

/* The same, not brought in order: of a sum of many products only the last one is, by gbt_gathered. */
static inline gbt_wide gbt_gather(gbt_wide c, gbt_wide a, gbt_wide b)
{
    const gbt_real product = a.high * b.high, rest = fmaf(a.high, b.high, -product);
    const gbt_wide sum = gbt_sum_of(c.high, product);
    const gbt_wide wide = {sum.high, c.low + (sum.low + fmaf(a.high, b.low, fmaf(a.low, b.high, rest)))};
    return wide;
}

static inline gbt_wide gbt_gathered(gbt_wide a) { return gbt_sum_of(a.high, a.low); }

/* 2 to the n from -126 to 127, by the bits of a float, which are its sign, eight of the exponent and the rest. */
static inline gbt_real gbt_power_of_two(int n)
{
    const union {
        uint32_t bits;
        float number;
    } power = {(uint32_t)(n + 127) << 23};
    return power.number;
}

/* e^a: an eighth power of two from a table times Taylor's series of what is left, below 0.044, of which the terms from the
   fifth on are so small that float does for them. */
static inline gbt_wide gbt_wide_exp(gbt_wide a)
{
    static const gbt_wide power[8] = {
        {1, 0}, {1.09050775f, -1.30775399e-08f}, {1.18920708f, 3.79763527e-08f}, {1.29683959f, -4.01899953e-08f},
        {1.41421354f, 2.4203235e-08f}, {1.54221082f, 8.07090483e-09f}, {1.68179286f, -2.47553267e-08f},
        {1.8340081f, -1.1239278e-08f}};
    static const gbt_wide sixth = {0.166666672f, -4.96705388e-09f}, twenty_fourth = {0.0416666679f, -1.24176347e-09f};
    static const gbt_wide log_two_rest = {-2.65243052e-05f, 2.05824371e-13f}; /* (ln 2 - 0.693359375) / 8 */
    const gbt_real count = rintf(a.high * 11.5415603f);
    gbt_wide part = gbt_sum_of(a.high, -count * 0.086669921875f);
    if (!(a.high > -80)) return gbt_widen(0);
    const int whole = (int)count, eighth = whole & 7;
    part = gbt_more(gbt_plus(part, gbt_widen(a.low)), gbt_widen(-count), log_two_rest);
    const gbt_real x = part.high;
    gbt_wide sum = gbt_more(twenty_fourth, part, gbt_widen((1 + x / 6 * (1 + x / 7 * (1 + x / 8))) / 120));
    sum = gbt_more(sixth, part, sum);
    sum = gbt_more(gbt_widen(0.5f), part, sum);
    sum = gbt_more(gbt_widen(1), part, sum);
    sum = gbt_more(power[eighth], power[eighth], gbt_times(part, sum));
    const gbt_real scale = gbt_power_of_two((whole - eighth) / 8);
    sum.high *= scale;
    sum.low *= scale;
    return sum;
}

/* log (1 + a) by a step of Newton's method. */
static inline gbt_wide gbt_wide_log1p(gbt_wide a)
{
    const gbt_real first = gbt_log1p(a.high);
    const gbt_wide grown = gbt_times(gbt_plus(gbt_widen(1), a), gbt_wide_exp(gbt_widen(-first)));
    return gbt_plus(gbt_widen(first), gbt_plus(grown, gbt_widen(-1)));
}

#else

typedef double gbt_wide;
static inline gbt_wide gbt_widen(double a) { return a; }
static inline double gbt_narrow(gbt_wide a) { return a; }
static inline gbt_wide gbt_widen_double(double a) { return a; }
static inline gbt_wide gbt_plus(gbt_wide a, gbt_wide b) { return a + b; }
static inline gbt_wide gbt_times(gbt_wide a, gbt_wide b) { return a * b; }
static inline gbt_wide gbt_negative(gbt_wide a) { return -a; }
static inline gbt_wide gbt_over(gbt_wide a, gbt_wide b) { return a / b; }
static inline gbt_wide gbt_root(gbt_wide a) { return sqrt(a); }
static inline gbt_wide gbt_wide_exp(gbt_wide a) { return exp(a); }
static inline gbt_wide gbt_wide_log1p(gbt_wide a) { return log1p(a); }
static inline gbt_wide gbt_more(gbt_wide c, gbt_wide a, gbt_wide b) { return c + a * b; }
static inline gbt_wide gbt_gather(gbt_wide c, gbt_wide a, gbt_wide b) { return c + a * b; }
static inline gbt_wide gbt_gathered(gbt_wide a) { return a; }

#endif

/* c - a b */
static inline gbt_wide gbt_gather_less(gbt_wide c, gbt_wide a, gbt_wide b) { return gbt_gather(c, gbt_negative(a), b); }

GBT_END_C

#endif
