#include "gbt_slacks.h"

#include "gbt_math.h"

#define BLOCK 64 /* sides of a piece that are taken together, so that the compiler can do several at once */
/* Sides whose factors are multiplied at once, a divisor of BLOCK, and two to the EXPONENT, up to which a product of all
   may go: it times such a product, which may go up to its square, is still a number. */
#ifdef GBT_SINGLE
#define TOGETHER 2
#define EXPONENT 35
#define EDGE ((gbt_real)0x1p35)
#else
#define TOGETHER 8
#define EXPONENT 340
#define EDGE ((gbt_real)0x1p340)
#endif
#define LOG_TWO ((gbt_real)0.6931471805599453)
#define LIFT ((gbt_real)0.3) /* first multiplier of a violated side: small, however much it is violated */

/* All sides of the part of the horizon that is solved: k is the number of one, and j that within its piece. */
#define FOR_ALL_SIDES(work)                                                                \
    for (int first_ = 0; first_ < (work)->count; first_ += GBT_SIDES_OF_PIECE)             \
        for (int j = 0, k = first_; j < GBT_SIDES_OF_PIECE; j++, k++)

/* The best s and t for s - t = excess, where m = mu / c: the minimum of s - m log s - m log t. The smaller one is
   written as a sum, since the difference that first comes to mind cancels. Returns s + t, which is s t / m. */
static inline gbt_real split(gbt_real excess, gbt_real m, gbt_real *s, gbt_real *t)
{
    const gbt_real size = gbt_fabs(excess), root = gbt_sqrt(size * size + 4 * m * m);
    const gbt_real large = m + (root + size) / 2, small = m + 2 * m * m / (root + size);
    *s = excess > 0 ? large : small;
    *t = excess > 0 ? small : large;
    return 2 * m + root;
}

/* e, and e after a step alpha; without penalties there is none. */
static inline gbt_real e_of(const gbt_workspace *work, int k) { return GBT_SOFT ? work->e[k] : 0; }

static inline gbt_real e_after(const gbt_workspace *work, int k, gbt_real alpha)
{
    return GBT_SOFT ? work->e[k] + alpha * work->de[k] : 0;
}

/* Step of lambda. */
static inline gbt_real dlambda_of(const gbt_workspace *work, int k)
{
    return (work->step_of.dy[k] + work->shift[k]) * work->sigma[k];
}

/* The cost at the values y of the sides after a step alpha of e. Since s t = m (s + t), the barrier is mu times the
   logarithm of the product of all s + t. That of some factors together neither overflows nor vanishes; of that of all,
   powers of two are counted apart. */
static gbt_real cost_of(const gbt_workspace *work, const gbt_real *y, gbt_real mu, gbt_real alpha)
{
    gbt_real sum = 0, product = 1, scales = 0, s[BLOCK], both[BLOCK];
    for (int piece = 0; piece < work->count; piece += GBT_SIDES_OF_PIECE)
        for (int first = 0; first < GBT_SIDES_OF_PIECE; first += BLOCK) {
            const int count = GBT_SIDES_OF_PIECE - first < BLOCK ? GBT_SIDES_OF_PIECE - first : BLOCK;
            const gbt_real *c = work->c + first, *width = work->width + first;
            for (int b = 0, k = piece + first; b < count; b++, k++) {
                gbt_real t;
                both[b] = split(y[k] + width[b] - e_after(work, k, alpha), mu * work->inverse[first + b], &s[b], &t);
            }
            for (int b = 0, k = piece + first; b < count; b++, k++) {
                const gbt_real e = e_after(work, k, alpha);
                sum += c[b] * s[b];
                if (GBT_SOFT && width[b] > 0) sum += c[b] * e * e / (4 * width[b]);
            }
            for (int b = count; b % TOGETHER != 0; b++) both[b] = 1;
            for (int b = 0; b < count; b += TOGETHER) {
                gbt_real part = both[b];
                GBT_UNROLLED
                for (int a = 1; a < TOGETHER; a++) part *= both[b + a];
                product *= part;
                if (product < 1 / EDGE) {
                    product *= EDGE * EDGE;
                    scales--;
                } else if (product > EDGE) {
                    product /= EDGE * EDGE;
                    scales++;
                }
            }
        }
    return sum - mu * (gbt_log(product) + scales * (2 * EXPONENT * LOG_TWO));
}

/* s and t for work->y and work->e. */
static void set_slacks(gbt_workspace *work, gbt_real mu)
{
    FOR_ALL_SIDES(work)
        split(work->y[k] + work->width[j] - e_of(work, k), mu * work->inverse[j], &work->s[k], &work->t[k]);
}

void gbt_lift(gbt_workspace *work, gbt_real mu)
{
    FOR_ALL_SIDES(work) {
        const gbt_real c = work->c[j], most = LIFT < c / 2 ? LIFT : c / 2;
        gbt_real s, t;
        split(work->y[k] + work->width[j], mu / c, &s, &t);
        work->lambda[k] = mu / t < most ? mu / t : most;
        if (GBT_SOFT) work->e[k] = 2 * work->width[j] * work->lambda[k] / c;
    }
}

gbt_real gbt_centre(gbt_workspace *work, gbt_real mu)
{
    set_slacks(work, mu);
    return cost_of(work, work->y, mu, 0);
}

gbt_real gbt_off_centre(const gbt_workspace *work, gbt_real mu)
{
    gbt_real worst = 0;
    FOR_ALL_SIDES(work) {
        const gbt_real c = work->c[j], lambda = work->lambda[k];
        const gbt_real off[3] = {lambda * work->t[k] - mu, (c - lambda) * work->s[k] - mu,
                                 (2 * work->width[j] * lambda / c - e_of(work, k)) * lambda};
        for (int a = 0; a < 2 + GBT_SOFT; a++)
            if (gbt_fabs(off[a]) > worst) worst = gbt_fabs(off[a]);
    }
    return worst;
}

void gbt_eliminate(gbt_workspace *work, gbt_real mu)
{
    FOR_ALL_SIDES(work) {
        const gbt_real lambda = work->lambda[k], soft = 2 * work->width[j] * work->inverse[j];
        const gbt_real inverse_lambda = 1 / lambda, inverse_nu = 1 / (work->c[j] - lambda);
        const gbt_real s = work->s[k], t = work->t[k];
        work->sigma[k] = 1 / (soft + t * inverse_lambda + s * inverse_nu);
        work->shift[k] = (e_of(work, k) - soft * lambda) + (s - mu * inverse_nu) - (t - mu * inverse_lambda);
        work->step_of.target[k] = lambda + work->shift[k] * work->sigma[k];
    }
}

void gbt_correct(gbt_workspace *work, gbt_real mu)
{
    FOR_ALL_SIDES(work) {
        const gbt_real lambda = work->lambda[k], dlambda = dlambda_of(work, k);
        const gbt_real inverse_lambda = 1 / lambda, inverse_nu = 1 / (work->c[j] - lambda);
        const gbt_real ds = (mu + work->s[k] * dlambda) * inverse_nu - work->s[k];
        const gbt_real dt = (mu - work->t[k] * dlambda) * inverse_lambda - work->t[k];
        work->shift[k] += work->y_trial[k] - (work->y[k] + work->step_of.dy[k]) -
                          dlambda * (dt * inverse_lambda + ds * inverse_nu);
        work->step_of.target[k] = lambda + work->shift[k] * work->sigma[k];
    }
}

void gbt_recover(gbt_workspace *work)
{
    if (GBT_SOFT)
        FOR_ALL_SIDES(work)
            work->de[k] = 2 * work->width[j] * work->inverse[j] * (work->lambda[k] + dlambda_of(work, k)) - work->e[k];
}

gbt_real gbt_barrier(const gbt_workspace *work, gbt_real mu, gbt_real alpha)
{
    return cost_of(work, work->y_trial, mu, alpha);
}

gbt_real gbt_barrier_slope(const gbt_workspace *work, gbt_real mu)
{
    gbt_real sum = 0, change[BLOCK];
    for (int first = 0; first < work->count; first += BLOCK) {
        const int count = work->count - first < BLOCK ? work->count - first : BLOCK;
        for (int b = 0, k = first; b < count; b++, k++)
            change[b] = (work->step_of.dy[k] - (GBT_SOFT ? work->de[k] : 0)) / work->t[k];
        for (int b = 0; b < count; b++) sum += mu * change[b];
    }
    if (GBT_SOFT)
        FOR_ALL_SIDES(work) {
            const gbt_real w = work->width[j];
            if (w > 0) sum += work->c[j] * work->e[k] / (2 * w) * work->de[k];
        }
    return sum;
}

gbt_real gbt_penalty(const gbt_workspace *work)
{
    gbt_real sum = 0;
    FOR_ALL_SIDES(work) {
        const gbt_real y = work->y[k], w = work->width[j];
        if (y > w)
            sum += work->c[j] * y;
        else if (y > -w)
            sum += work->c[j] * (y + w) * (y + w) / (4 * w);
    }
    return sum;
}

void gbt_move_sides(gbt_workspace *work, gbt_real mu, gbt_real alpha, gbt_real fraction)
{
    FOR_ALL_SIDES(work) {
        const gbt_real c = work->c[j], old = work->lambda[k];
        const gbt_real least = (1 - fraction) * old, most = c - (1 - fraction) * (c - old);
        /* The multipliers go half as short as the trajectory: they tell what comes, and have no line search to fear. */
        const gbt_real lambda = old + (1 + alpha) / 2 * dlambda_of(work, k);
        work->lambda[k] = lambda < least ? least : lambda > most ? most : lambda;
        work->y[k] = work->y_trial[k];
        if (GBT_SOFT) work->e[k] += alpha * work->de[k];
    }
    set_slacks(work, mu);
}
