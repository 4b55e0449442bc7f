#include "gbt_polar.h"

#include "gbt_math.h"

#define D GBT_DIMENSION
#define NEAREST ((gbt_real)1e-2)     /* range below which a predicted position counts as so far away, m */
#define LEAST_LEVEL ((gbt_real)1e-3) /* share of the line of sight in the horizontal below which azimuths say nothing */

int gbt_can_take(const gbt_sighting *sighting, int begun, double latest)
{
    const gbt_kind kind = sighting->kind;
    int apart = 0;
    if (kind == GBT_SIZE && !GBT_SIZED) return 0;
    if (D == 2 && (kind == GBT_ELEVATION || kind == GBT_AZIMUTH_ELEVATION)) return 0;
    if (begun && sighting->time < latest) return 0;
    for (int k = 0; k < D; k++) {
        if (!isfinite(sighting->position[k])) return 0;
        if (k < gbt_components(kind) && !isfinite(sighting->value[k])) return 0;
        if (sighting->value[k] != sighting->position[k]) apart = 1;
    }
    if ((kind == GBT_RANGE || kind == GBT_SIZE) && !(sighting->value[0] > 0)) return 0;
    if (kind == GBT_SIZE && !(sighting->value[0] < GBT_TURN / 2)) return 0;
    if (kind == GBT_POSITION && !apart) return 0;
    return sighting->stated || !(kind == GBT_RANGE || kind == GBT_SIZE || kind == GBT_POSITION);
}

/* The measured direction; that of an azimuth in space is level. */
static void direction_of(const gbt_sighting *sighting, gbt_real *direction)
{
    if (sighting->kind == GBT_POSITION) {
        gbt_unit_bearing(sighting->value, sighting->position, direction);
        return;
    }
    const gbt_real angles[2] = {sighting->value[0], sighting->kind == GBT_AZIMUTH_ELEVATION ? sighting->value[1] : 0};
    gbt_unit_of_angles(angles, direction);
}

/* A range, or an angular size. */
static void lengths(const gbt_sighting *sighting, gbt_real log_size, gbt_polar_rows *rows)
{
    const gbt_real value = sighting->value[0], std = sighting->std[0];
    rows->rows = 1;
    if (sighting->kind == GBT_RANGE) {
        rows->along[0] = 1;
        rows->residuals[0] = gbt_log(value) - gbt_log(rows->range);
        rows->std[0] = std / value;
    } else {
        rows->along[0] = -1;
        rows->size[0] = 1;
        rows->residuals[0] = gbt_log(2 * gbt_tan(value / 2)) - (log_size - gbt_log(rows->range));
        rows->std[0] = std / gbt_sin(value); /* d log tan(x/2) = dx / sin x */
    }
}

/* A position as its direction and the logarithm of its range; its deviations are taken along these. */
static void place(const gbt_sighting *sighting, gbt_polar_rows *rows)
{
    gbt_real seen[D], line[D], basis[GBT_AXES][D];
    gbt_unit_bearing(sighting->value, sighting->position, seen);
    for (int k = 0; k < D; k++) line[k] = sighting->value[k] - sighting->position[k];
    const gbt_real far = gbt_length(line);
    gbt_tangent_basis(rows->unit, basis);
    gbt_log_map(rows->unit, seen, basis, rows->residuals);
    rows->rows = D;
    for (int r = 0; r < D; r++) {
        gbt_real square = 0;
        for (int k = 0; k < D; k++) {
            const gbt_real axis = r < GBT_AXES ? basis[r][k] : rows->unit[k];
            square += axis * axis * sighting->std[k] * sighting->std[k];
            rows->across[r][k] = r < GBT_AXES ? axis : 0;
        }
        rows->std[r] = gbt_sqrt(square) / far;
    }
    rows->along[D - 1] = 1;
    rows->residuals[D - 1] = gbt_log(far) - gbt_log(rows->range);
}

#if GBT_DIMENSION == 3
/* Azimuth, elevation, or both. An azimuth is an angle across the line times the cosine of the elevation. */
static void in_space(const gbt_sighting *sighting, gbt_real bearing_std, gbt_polar_rows *rows)
{
    const gbt_real *unit = rows->unit;
    const gbt_real level = gbt_fmax(gbt_hypot(unit[0], unit[1]), LEAST_LEVEL);
    const gbt_real east = unit[0] / level, north = unit[1] / level, up = unit[2];
    gbt_real basis[GBT_AXES][D] = {{-north, east, 0}, {-up * east, -up * north, level}}, turned[GBT_AXES];
    const int both = sighting->kind == GBT_AZIMUTH_ELEVATION;
    const gbt_real first = sighting->stated ? sighting->std[0] : bearing_std;
    const gbt_real last = sighting->stated ? sighting->std[both] : bearing_std;
    if (both) {
        gbt_real seen[D];
        direction_of(sighting, seen);
        gbt_log_map(unit, seen, basis, turned);
    }
    rows->rows = 0;
    if (sighting->kind != GBT_ELEVATION) {
        const gbt_real turn = sighting->value[0] - gbt_atan2(unit[1], unit[0]);
        /* the deviation of an azimuth is that of the angle about the vertical */
        rows->std[0] = first * (both ? gbt_fmax(gbt_cos(sighting->value[1]), LEAST_LEVEL) : level);
        rows->residuals[0] = both ? turned[0] : level * gbt_atan2(gbt_sin(turn), gbt_cos(turn));
        for (int k = 0; k < D; k++) rows->across[0][k] = basis[0][k];
        rows->rows = 1;
    }
    if (sighting->kind != GBT_AZIMUTH) {
        const int r = rows->rows;
        rows->std[r] = last;
        rows->residuals[r] = both ? turned[1] : sighting->value[0] - gbt_atan2(up, level);
        for (int k = 0; k < D; k++) rows->across[r][k] = basis[1][k];
        rows->rows = r + 1;
    }
}
#endif

void gbt_polar_of(const gbt_sighting *sighting, const gbt_real *position, gbt_real bearing_std, gbt_real log_size,
                  gbt_polar_rows *rows)
{
    const gbt_kind kind = sighting->kind;
    gbt_real line[D];
    *rows = (gbt_polar_rows){0};
    for (int k = 0; k < D; k++) line[k] = position[k] - sighting->position[k];
    const gbt_real distance = gbt_length(line);
    if (distance > 0)
        for (int k = 0; k < D; k++) rows->unit[k] = line[k] / distance;
    else if (kind == GBT_RANGE || kind == GBT_SIZE || kind == GBT_ELEVATION)
        rows->unit[0] = 1;
    else
        direction_of(sighting, rows->unit);
    rows->range = distance < NEAREST ? NEAREST : distance;
    if (kind == GBT_RANGE || kind == GBT_SIZE) {
        lengths(sighting, log_size, rows);
        return;
    }
    if (kind == GBT_POSITION) {
        place(sighting, rows);
        return;
    }
#if GBT_DIMENSION == 2
    gbt_real seen[D], basis[GBT_AXES][D];
    direction_of(sighting, seen);
    gbt_tangent_basis(rows->unit, basis);
    gbt_log_map(rows->unit, seen, basis, rows->residuals);
    for (int k = 0; k < D; k++) rows->across[0][k] = basis[0][k];
    rows->std[0] = sighting->stated ? sighting->std[0] : bearing_std;
    rows->rows = 1;
#else
    in_space(sighting, bearing_std, rows);
#endif
}
