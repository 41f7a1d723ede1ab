/* A period of a gait in one call: balance at the points of a collocation scheme, several side by side, then orientation, place and
   work; and the adjoint, by which a gradient costs about what a value does, for chains of any number of links. Once for every
   number of lanes, from `lanes.h`. */

#define LANE_ITERATIONS 40
/* Largest residual times delta that is rounding. */
#define LANE_ROUNDING 1e-16

/* Inverse by cofactors, after symmetric scaling to a unit diagonal; 0 where that is singular. */
static inline void inverse3(Matrix3 A, Matrix3 B)
{
    Vector3 d;
    Matrix3 m, c;
    for (int i = 0; i < 3; ++i)
        d[i] = 1.0 / sqrt(lane_fmax(fabs(A[i][i]), ZERO + 1e-300));
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            m[i][j] = A[i][j] * d[i] * d[j];
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            const int p = (i + 1) % 3, q = (i + 2) % 3, r = (j + 1) % 3, t = (j + 2) % 3;
            c[j][i] = m[p][r] * m[q][t] - m[p][t] * m[q][r];
        }
    const Lanes determinant = m[0][0] * c[0][0] + m[0][1] * c[1][0] + m[0][2] * c[2][0];
    const Mask regular = fabs(determinant) > 1e-300;
    const Lanes per = SELECT(regular, 1.0 / SELECT(regular, determinant, 1.0), 0.0);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            B[i][j] = c[i][j] * per * d[i] * d[j];
}

static inline Lanes lane_largest(const Vector3 v)
{
    return lane_fmax(fabs(v[0]), lane_fmax(fabs(v[1]), fabs(v[2])));
}

/* Links and slidings of LANES instants; aligned as vectors have to be. */
typedef struct {
    Link *link;
    Sliding *k, *trial;
    Matrix3 *K;
    void *memory;
} Room;

static bool new_lanes(Room *room, const int n, const Law *law)
{
    const size_t links = (size_t)n, parts = (size_t)law->n_part, align = sizeof(Lanes);
    const size_t sizes[] = {links * sizeof(Link), links * sizeof(Matrix3), 2 * parts * sizeof(PartSliding), 2 * links * sizeof(Sliding)};
    char *at = room->memory = malloc(sizes[0] + sizes[1] + sizes[2] + sizes[3] + align);
    if (!at)
        return false;
    at += align - (size_t)at % align;
    room->link = (Link *)at;
    room->K = (Matrix3 *)(at += sizes[0]);
    PartSliding *part = (PartSliding *)(at += sizes[1]);
    room->k = (Sliding *)(at += sizes[2]), room->trial = room->k + n;
    for (int i = 0; i < n; ++i)
        room->k[i].part = part, room->trial[i].part = part + law->n_part;
    return true;
}

/* By Newton's method, damped and safeguarded as in damped_newton.h, from velocity z of the reference; the lanes that come to rest. */
static inline Mask lane_balance(
    const int n, Room *room, const Law *law, Lanes delta, double tolerance, Vector3 z)
{
    const Link *link = room->link;
    const int reference = n / 2, tries = law->associated ? 13 : 3;
    const Lanes enough = lane_fmax(ZERO + tolerance, LANE_ROUNDING / delta) * law->largest / sqrt(1.0 + delta * delta);
    Total at = evaluate(n, link, room->k, reference, z, law, delta);
    Mask going = ~(lane_largest(at.force) <= enough), due = going & 0; /* fixed-point steps that are due */
    for (int count = 0; count < LANE_ITERATIONS && ANY(going); ++count) {
        const Mask steep = going & (due > 0);
        Matrix3 left, inverse;
        Vector3 step, there;
        pull_back(n, link, room->k, law, delta, true, room->K, left);
        if (ANY(steep)) {
            pull_back(n, link, room->k, law, delta, false, room->K, inverse);
            for (int i = 0; i < 9; ++i)
                left[i / 3][i % 3] = SELECT(steep, inverse[i / 3][i % 3], left[i / 3][i % 3]);
        }
        inverse3(left, inverse);
        for (int i = 0; i < 3; ++i)
            step[i] = SELECT(going, inverse[i][0] * at.force[0] + inverse[i][1] * at.force[1] + inverse[i][2] * at.force[2], 0.0);
        Lanes slope = -2.0 * at.merit, slack = ZERO, alpha = ZERO + 1.0;
        if (law->associated) {
            slope = -(at.force[0] * step[0] + at.force[1] * step[1] + at.force[2] * step[2]);
            slack = ROUNDING * at.merit;
        }
        Mask open = going;
        Total next;
        for (int t = 0; t < tries && ANY(open); ++t) {
            alpha = t ? SELECT(open, alpha * BACKTRACKING[t - 1], alpha) : alpha;
            for (int i = 0; i < 3; ++i)
                there[i] = z[i] + alpha * step[i];
            next = evaluate(n, link, room->trial, reference, there, law, delta);
            open &= ~steep & ~(next.merit <= at.merit + ARMIJO * alpha * slope + slack);
        }
        due = (open & FIXED_POINT_STEPS_AFTER_FAILURE) | (~open & (due + steep)); /* steep: -1 where it is so */
        for (int i = 0; i < 3; ++i)
            z[i] = SELECT(open, z[i], there[i]);
        if (ANY(open))
            at = evaluate(n, link, room->k, reference, z, law, delta);
        else {
            Sliding *now = room->k;
            room->k = room->trial, room->trial = now, at = next;
        }
        going &= ~(lane_largest(at.force) <= enough);
    }
    return ~going;
}

/* The links at times from t on, moving as the tail does, with rates, velocities and delta in units of `speed`, which is returned. */
static inline Lanes lane_instants(const Played *b, Room *room, ptrdiff_t t, const double *tail, Vector3 z, Lanes *delta)
{
    const int n = b->n, reference = n / 2;
    Lanes angle[b->n], rate[b->n], speed = ZERO;
    Vector3 start;
    for (int j = 0; j < n - 1; ++j) {
        angle[j] = lane_load(b->angles + j * b->n_time, t, b->n_time);
        rate[j] = lane_load(b->rates + j * b->n_time, t, b->n_time);
        speed = lane_fmax(speed, fabs(rate[j]));
    }
    speed = SELECT(speed > 0, speed, 1.0);
    *delta = b->delta / speed;
    find_directions(n, room->link, b->length, b->mass, angle, rate, speed, 1);
    find_midpoints(n, room->link, reference);
    for (int i = 0; i < 3; ++i)
        start[i] = lane_load(tail + i * b->n_time, t, b->n_time) / speed;
    find_velocities_from_tail(n, room->link, room->k, start);
    link_velocity(&room->link[reference], &room->k[reference], z);
    return speed;
}

/* Tail velocities (3, n_time), at times from t on, moved along their derivatives from where b states them, `tail`, to other angles and
   rates: where several velocities balance a body, those of one branch. */
static inline void predict_tail(const Played *b, Room *room, ptrdiff_t t, const double *tail, const double *angles, const double *rates, double *to)
{
    const int n = b->n, reference = n / 2;
    Vector3 z, net = {ZERO, ZERO, ZERO}, dz;
    Matrix3 left, inverse;
    Lanes delta, phi[n], w[n], x[n], y[n], vx[n], vy[n];
    const Lanes speed = lane_instants(b, room, t, tail, z, &delta);
    const Link *link = room->link;
    const Sliding *k = room->k;
    Matrix3 *K = room->K;
    evaluate(n, link, room->k, reference, z, &b->law, delta);
    pull_back(n, link, k, &b->law, delta, true, room->K, left);
    inverse3(left, inverse);
    phi[0] = w[0] = ZERO;
    for (int i = 1; i < n; ++i) {
        const ptrdiff_t row = (i - 1) * b->n_time;
        phi[i] = phi[i - 1] + lane_load(angles + row, t, b->n_time) - lane_load(b->angles + row, t, b->n_time);
        w[i] = w[i - 1] + (lane_load(rates + row, t, b->n_time) - lane_load(b->rates + row, t, b->n_time)) / speed;
    }
    const Lanes turning = w[reference];
    for (int i = 0; i < n; ++i)
        w[i] -= turning;
    x[reference] = y[reference] = vx[reference] = vy[reference] = ZERO;
    for (int side = 1; side >= -1; side -= 2)
        for (int i = reference + side; i >= 0 && i < n; i += side) {
            x[i] = x[i - side], y[i] = y[i - side], vx[i] = vx[i - side], vy[i] = vy[i - side];
            for (int q = i - side; q != i + side; q += side) {
                const Lanes half = ZERO + 0.5 * side * link[q].length, c = half * link[q].cos, s = half * link[q].sin;
                x[i] -= s * phi[q], y[i] += c * phi[q];
                vx[i] -= s * w[q] + c * k[q].w * phi[q], vy[i] += c * w[q] - s * k[q].w * phi[q];
            }
        }
    for (int i = 0; i < n; ++i) {
        const Lanes c = link[i].cos, s = link[i].sin, fx = k[i].fs * c - k[i].fn * s, fy = k[i].fs * s + k[i].fn * c;
        const Vector3 d = {vx[i] * c + vy[i] * s + k[i].vn * phi[i], vy[i] * c - vx[i] * s - k[i].vs * phi[i], w[i]};
        Vector3 df;
        for (int row = 0; row < 3; ++row)
            df[row] = -(K[i][row][0] * d[0] + K[i][row][1] * d[1] + K[i][row][2] * d[2]);
        const Lanes dfx = df[0] * c - df[1] * s - phi[i] * fy, dfy = df[0] * s + df[1] * c + phi[i] * fx;
        net[0] += dfx, net[1] += dfy;
        net[2] += x[i] * fy - y[i] * fx + link[i].x * dfy - link[i].y * dfx + df[2];
    }
    for (int i = 0; i < 3; ++i)
        dz[i] = inverse[i][0] * net[0] + inverse[i][1] * net[1] + inverse[i][2] * net[2];
    const Lanes rate = w[0] + dz[2];
    const Vector3 change = {vx[0] + dz[0] - link[0].y * dz[2], vy[0] + dz[1] + link[0].x * dz[2] - 0.5 * link[0].length * rate, rate};
    for (int i = 0; i < 3; ++i)
        lane_store(to + i * b->n_time, t, b->n_time, lane_load(tail + i * b->n_time, t, b->n_time) + change[i] * speed);
}

/* Derivatives of a number along angles and rates, (2 (n - 1)), from those along out, by the adjoint of the balance and of the
   chain. K: slopes of friction; inverse: of their sum. */
static inline void pull_to_shape(
    const int n, const Link *link, const Sliding *k, Matrix3 *K, Matrix3 inverse, const Lanes on_out[OUTPUTS], Lanes *on_shape)
{
    const int reference = n / 2;
    const Lanes on_turning = on_out[TURNING], on_x = on_out[ALONG], on_y = on_out[ACROSS], on_power = on_out[POWER];
    Lanes on_phi[n], on_rate[n], gx[n], gy[n], on_px[n], on_py[n];
    Vector3 on_z = {ZERO, ZERO, on_turning}, multiplier;
    for (int i = 0; i < n; ++i) {
        const Lanes c = link[i].cos, s = link[i].sin;
        const Lanes hs = on_power * (K[i][0][0] * k[i].vs + K[i][1][0] * k[i].vn + K[i][2][0] * k[i].w - k[i].fs);
        const Lanes hn = on_power * (K[i][0][1] * k[i].vs + K[i][1][1] * k[i].vn + K[i][2][1] * k[i].w - k[i].fn);
        const Lanes hw = on_power * (K[i][0][2] * k[i].vs + K[i][1][2] * k[i].vn + K[i][2][2] * k[i].w - k[i].couple);
        const Lanes x = hs * c - hn * s + link[i].mass * on_x, y = hs * s + hn * c + link[i].mass * on_y;
        on_z[0] += x, on_z[1] += y, on_z[2] += link[i].x * y - link[i].y * x + hw;
    }
    for (int i = 0; i < 3; ++i)
        multiplier[i] = inverse[0][i] * on_z[0] + inverse[1][i] * on_z[1] + inverse[2][i] * on_z[2];
    for (int i = 0; i < n; ++i) {
        const Lanes c = link[i].cos, s = link[i].sin;
        const Lanes ux = multiplier[0] - multiplier[2] * link[i].y, uy = multiplier[1] + multiplier[2] * link[i].x;
        const Lanes us = ux * c + uy * s, un = uy * c - ux * s;
        const Lanes gs = us - on_power * k[i].vs, gn = un - on_power * k[i].vn, gw = multiplier[2] - on_power * k[i].w;
        const Lanes hs = -(K[i][0][0] * gs + K[i][1][0] * gn + K[i][2][0] * gw) - on_power * k[i].fs;
        const Lanes hn = -(K[i][0][1] * gs + K[i][1][1] * gn + K[i][2][1] * gw) - on_power * k[i].fn;
        const Lanes hw = -(K[i][0][2] * gs + K[i][1][2] * gn + K[i][2][2] * gw) - on_power * k[i].couple;
        on_px[i] = multiplier[2] * (k[i].fs * s + k[i].fn * c), on_py[i] = -multiplier[2] * (k[i].fs * c - k[i].fn * s);
        gx[i] = hs * c - hn * s + link[i].mass * on_x, gy[i] = hs * s + hn * c + link[i].mass * on_y;
        on_phi[i] = hs * k[i].vn - hn * k[i].vs + k[i].fs * un - k[i].fn * us;
        on_rate[i] = i ? hw : hw + on_turning;
    }
    for (int side = 1; side >= -1; side -= 2) { /* from either end to the reference */
        Lanes px = ZERO, py = ZERO, vx = ZERO, vy = ZERO;
        for (int i = side > 0 ? n - 1 : 0; i != reference; i -= side) {
            px += on_px[i], py += on_py[i], vx += gx[i], vy += gy[i];
            for (int two = 0; two < 2; ++two) {
                const int q = i - two * side;
                const Lanes c = link[q].cos, s = link[q].sin, half = ZERO + 0.5 * side * link[q].length;
                on_phi[q] += half * (py * c - px * s - k[q].w * (vx * c + vy * s));
                on_rate[q] += half * (vy * c - vx * s);
            }
        }
    }
    Lanes phi = ZERO, rate = ZERO;
    for (int j = n - 2; j >= 0; --j) { /* a joint turns all links ahead; turning all of them changes nothing, by the balance */
        phi += on_phi[j + 1], rate += on_rate[j + 1];
        on_shape[j] = phi, on_shape[n - 1 + j] = rate;
    }
}

/* Motion through a period, begun from another one: its angles, rates, delta and tail velocities `start` (3, n_time). Velocities in
   balance `z` (3, n_time), out (OUTPUTS, n_time), and the totals. `lost`: the number of instants without a balance. */
int colloc_period(
    CHAIN, MESH, const double *start_angles, const double *start_rates, double start_delta, const double *start, double tolerance,
    double *z, double *out, double *totals, long long *lost)
{
    Played played = PLAYED, other = PLAYED;
    const Mesh mesh = MESHED;
    Room room = {0};
    const bool ready = new_room(&played) && new_lanes(&room, n, &played.law);
    State state = {.law = played.law, .link = played.link, .now = played.k, .trial = played.k + n, .K = played.K};
    double *turned = malloc(2 * (size_t)(n_interval * s) * sizeof *turned);
    other.angles = start_angles, other.rates = start_rates, other.delta = start_delta;
    *lost = 0;
    for (ptrdiff_t t = first; t < last && ready && turned; t += LANES) {
        Vector3 velocity;
        Lanes own_delta;
        predict_tail(&other, &room, t, start, angles, rates, z);
        const Lanes speed = lane_instants(&played, &room, t, z, velocity, &own_delta);
        const Mask at_rest = lane_balance(n, &room, &played.law, own_delta, tolerance, velocity);
        if (ANY(~at_rest)) {
            tail_velocity(room.link, room.k, velocity);
            for (int i = 0; i < LANES && t + i < last; ++i) {
                double tail[3];
                if (at_rest[i])
                    continue;
                *lost += !rescue(&played, &state, t + i, z, tolerance, tail);
                for (int j = 0; j < 3; ++j)
                    velocity[j][i] = tail[j] / speed[i];
            }
            find_velocities_from_tail(n, room.link, room.k, velocity);
            link_velocity(&room.link[n / 2], &room.k[n / 2], velocity);
            evaluate(n, room.link, room.k, n / 2, velocity, &played.law, own_delta);
        }
        Lanes x = ZERO, y = ZERO, power = ZERO;
        for (int i = 0; i < n; ++i) {
            const Sliding *k = &room.k[i];
            link_velocity(&room.link[i], k, velocity);
            x += played.mass[i] * velocity[0], y += played.mass[i] * velocity[1];
            power -= k->fs * k->vs + k->fn * k->vn + k->couple * k->w;
        }
        tail_velocity(room.link, room.k, velocity);
        for (int i = 0; i < 3; ++i)
            lane_store(z + i * n_time, t, n_time, velocity[i] * speed);
        lane_store(out + TURNING * n_time, t, n_time, velocity[2] * speed);
        lane_store(out + ALONG * n_time, t, n_time, x * speed);
        lane_store(out + ACROSS * n_time, t, n_time, y * speed);
        lane_store(out + POWER * n_time, t, n_time, power * speed);
    }
    double way;
    const double even = even_rate(&mesh, &way);
    for (ptrdiff_t t = 0; t < n_time; ++t)
        out[TURNING * n_time + t] -= even;
    if (ready && turned)
        find_pose(&mesh, out, turned, totals);
    free(turned), free(room.memory);
    return done(&played, ready && turned);
}

/* Derivatives of `count` numbers along angles and rates (count, n_time, 2 (n - 1)) and along the pace (count, n_time), from those along
   the totals, `on` (count, TOTALS), at a motion that `colloc_period` states. */
int colloc_period_vjp(
    CHAIN, MESH, const double *z, const double *out, int count, const double *on, double *on_shape, double *on_pace)
{
    Played played = PLAYED;
    const Mesh mesh = MESHED;
    const int columns = 2 * (n - 1);
    Room room = {0};
    double totals[TOTALS];
    double *turned = malloc((2 * (size_t)(n_interval * s) + (size_t)(count * OUTPUTS * n_time)) * sizeof *turned);
    const bool ready = new_room(&played) && new_lanes(&room, n, &played.law) && turned;
    double *weights = turned + 2 * n_interval * s;
    if (ready) {
        find_pose(&mesh, out, turned, totals);
        for (int row = 0; row < count; ++row)
            find_weights(&mesh, out, turned, on + TOTALS * row, weights + row * OUTPUTS * n_time, on_pace + row * n_time);
    }
    for (ptrdiff_t t = first; t < last && ready; t += LANES) {
        Vector3 velocity;
        Matrix3 left, inverse;
        Lanes own_delta, pulled[columns];
        const Lanes speed = lane_instants(&played, &room, t, z, velocity, &own_delta), paced = lane_load(pace, t, n_time);
        evaluate(n, room.link, room.k, n / 2, velocity, &played.law, own_delta);
        pull_back(n, room.link, room.k, &played.law, own_delta, true, room.K, left);
        inverse3(left, inverse);
        for (int row = 0; row < count; ++row) {
            Lanes on_out[OUTPUTS];
            for (int i = 0; i < OUTPUTS; ++i)
                on_out[i] = paced * lane_load(weights + (row * OUTPUTS + i) * n_time, t, n_time);
            pull_to_shape(n, room.link, room.k, room.K, inverse, on_out, pulled);
            for (int j = 0; j < columns; ++j) {
                const Lanes value = j < n - 1 ? pulled[j] * speed : pulled[j];
                for (int i = 0; i < LANES && t + i < n_time; ++i)
                    on_shape[(row * n_time + t + i) * columns + j] = value[i];
            }
        }
    }
    free(turned), free(room.memory);
    return done(&played, ready);
}

/* Velocities in balance (3, n_time) from `start` (3, n_time), side by side; `lost` (n_time): 1 where none is found. */
int colloc_balances(CHAIN, const double *start, double tolerance, double *z, long long *lost)
{
    Played played = PLAYED;
    Room room = {0};
    const bool ready = new_room(&played) && new_lanes(&room, n, &played.law);
    for (ptrdiff_t t = first; t < last && ready; t += LANES) {
        Vector3 velocity;
        Lanes own_delta;
        const Lanes speed = lane_instants(&played, &room, t, start, velocity, &own_delta);
        const Mask at_rest = lane_balance(n, &room, &played.law, own_delta, tolerance, velocity);
        tail_velocity(room.link, room.k, velocity);
        for (int i = 0; i < 3; ++i)
            lane_store(z + i * n_time, t, last, velocity[i] * speed);
        for (int i = 0; i < LANES && t + i < last; ++i)
            lost[t + i] = !at_rest[i];
    }
    free(room.memory);
    return done(&played, ready);
}
