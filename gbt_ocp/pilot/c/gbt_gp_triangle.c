#include "gbt_gp_triangle.h"

#include "gbt_math.h"

#define R GBT_ROWS_OF_WINDOW
#define ROW GBT_ROW_BEGIN

int gbt_factor(gbt_wide *lower, int n)
{
    for (int i = 0; i < n; i++) {
        gbt_wide *row = lower + ROW(i);
        for (int j = 0; j <= i; j++) {
            const gbt_wide *other = lower + ROW(j);
            gbt_wide rest = row[j];
            for (int k = 0; k < j; k++) rest = gbt_gather_less(rest, row[k], other[k]);
            rest = gbt_gathered(rest);
            if (j == i && !(gbt_narrow(rest) > 0 && isfinite(gbt_narrow(rest)))) return 0;
            row[j] = j == i ? gbt_over(gbt_widen(1), gbt_root(rest)) : gbt_times(rest, other[j]);
        }
    }
    return 1;
}

void gbt_invert_factor(gbt_wide *lower, int n)
{
    gbt_wide sum[R];
    for (int i = 0; i < n; i++) {
        gbt_wide *row = lower + ROW(i);
        for (int k = 0; k < i; k++) {
            const gbt_wide *above = lower + ROW(k);
            sum[k] = gbt_widen(0);
            for (int j = 0; j <= k; j++) sum[j] = gbt_gather_less(sum[j], row[k], above[j]);
        }
        for (int j = 0; j < i; j++) row[j] = gbt_times(gbt_gathered(sum[j]), row[i]);
    }
}

/* Row i of a b', both lower triangles, as far as the diagonal, from that row of a. */
static void times_transposed(const gbt_wide *row, const gbt_wide *lower, int i, gbt_wide *out)
{
    for (int j = i; j >= 0; j--) {
        const gbt_wide *other = lower + ROW(j);
        gbt_wide sum = gbt_widen(0);
        for (int k = 0; k <= j; k++) sum = gbt_gather(sum, row[k], other[k]);
        out[j] = gbt_gathered(sum);
    }
}

/* The last row first, which needs none after it. */
void gbt_whiten_symmetric(const gbt_wide *inverse, int n, gbt_wide *a)
{
    gbt_wide half[R];
    for (int i = n - 1; i >= 0; i--) {
        const gbt_wide *weight = inverse + ROW(i);
        for (int k = 0; k <= i; k++) {
            /* an entry below the diagonal counts for its row and for its column */
            const gbt_wide *row = a + ROW(k), own = weight[k];
            gbt_wide sum = gbt_times(own, row[k]);
            for (int j = 0; j < k; j++) {
                half[j] = gbt_gather(half[j], own, row[j]);
                sum = gbt_gather(sum, weight[j], row[j]);
            }
            half[k] = sum;
        }
        for (int k = 0; k <= i; k++) half[k] = gbt_gathered(half[k]);
        times_transposed(half, inverse, i, a + ROW(i));
    }
}

/* The number times the squares of a row is at most 1: sums in gbt_real are as good as wide ones. */
void gbt_whiten_identity(const gbt_wide *inverse, int n, gbt_real number, gbt_wide *a)
{
    for (int i = 0; i < n; i++)
        for (int j = 0; j <= i; j++) {
            const gbt_wide *row = inverse + ROW(i), *other = inverse + ROW(j);
            gbt_real sum = 0;
            for (int k = 0; k <= j; k++) sum += gbt_narrow(row[k]) * gbt_narrow(other[k]);
            a[ROW(i) + j] = gbt_widen(number * sum);
        }
}

gbt_real gbt_trace(gbt_block a)
{
    gbt_real sum = 0;
    for (int i = 0; i < a.rows; i++) sum += gbt_narrow(a.lower[ROW(i) + i]);
    return sum;
}

gbt_real gbt_form_of(gbt_block a, const gbt_wide *x)
{
    gbt_real sum = 0;
    for (int i = 0; i < a.rows; i++) {
        const gbt_wide *row = a.lower + ROW(i);
        gbt_real part = 0;
        for (int j = 0; j < i; j++) part += gbt_narrow(row[j]) * gbt_narrow(x[a.first + j]);
        sum += gbt_narrow(x[a.first + i]) * (2 * part + gbt_narrow(row[i]) * gbt_narrow(x[a.first + i]));
    }
    return sum;
}

gbt_real gbt_trace_of_product(gbt_block a, gbt_block b)
{
    const int inside = a.first - b.first;
    gbt_real sum = 0;
    for (int i = 0; i < a.rows; i++) {
        const gbt_wide *row = a.lower + ROW(i), *other = b.lower + ROW(i + inside) + inside;
        gbt_real part = 0;
        for (int j = 0; j < i; j++) part += gbt_narrow(row[j]) * gbt_narrow(other[j]);
        sum += 2 * part + gbt_narrow(row[i]) * gbt_narrow(other[i]);
    }
    return sum;
}
