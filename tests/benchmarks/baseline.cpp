// The models as one would write them in C++: what tests/benchmarks/against_cpp.py measures our kernels against.
//
// A process of its own, because -ffast-math makes whoever loads it flush subnormal numbers. It reads from the folder
// that is its argument, then answers requests, one a line:
//   time KERNEL SECONDS PARAMETERS...   run KERNEL for that long: median and least seconds of a pass
//   dump KERNEL FILE PARAMETERS...      run it once and write its values
// Numbers are double, or float if REAL says so and -fsingle-precision-constant makes constants float, too.

#include <sys/mman.h>
#include <time.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <iostream>
#include <limits>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#ifndef REAL
#define REAL double
#endif

namespace {

using Real = REAL;

constexpr Real PI = 3.14159265358979323846;
using Parameters = std::vector<double>;

// Huge pages for large arrays, as NumPy asks for them
struct Array {
    Real* data = nullptr;
    std::size_t size = 0;
    explicit Array(std::size_t count) : size(count) {
        constexpr std::size_t page = 1 << 21;
        const std::size_t bytes = (count * sizeof(Real) + page - 1) / page * page;
        data = static_cast<Real*>(std::aligned_alloc(page, bytes));
        madvise(data, bytes, MADV_HUGEPAGE);
        std::fill(data, data + count, 0.0);
    }
};

Array read(const std::string& path) {
    std::ifstream file(path, std::ios::binary | std::ios::ate);
    const std::size_t count = file.tellg() / sizeof(Real);
    Array array(count);
    file.seekg(0);
    file.read(reinterpret_cast<char*>(array.data), count * sizeof(Real));
    return array;
}

// ---- Ward, eq. (5a)

inline Real ward(Real xi, Real yi, Real zi, Real xr, Real yr, Real zr, Real diffuse, Real peak,
                   Real ux, Real uy) {
    const Real hx = (xi + xr) * ux, hy = (yi + yr) * uy, hz = zi + zr;
    const Real f = diffuse + peak / std::sqrt(zi * zr) * std::exp(-(hx * hx + hy * hy) / (hz * hz));
    return zi < 0.0 || zr < 0.0 ? 0.0 : f;
}

struct WardSurface {
    Real diffuse, peak, ux, uy;
    explicit WardSurface(const Parameters& p)
        : diffuse(p[0] / PI), peak(p[1] / (4.0 * PI * p[2] * p[3])), ux(1.0 / p[2]), uy(1.0 / p[3]) {}
};

// ---- GGX facets, correlated shadowing, and the reflectance of a metal or Schlick's

struct FacetSurface {
    Real diffuse, f_0, n, k, ax, ay, ux, uy, peak;
    bool schlick;
    FacetSurface(const Parameters& p, bool schlick) : schlick(schlick) {
        diffuse = schlick ? p[0] / PI : 0.0, f_0 = schlick ? p[1] : 0.0;
        ax = p[schlick ? 2 : 0], ay = p[schlick ? 3 : 1];
        n = schlick ? 1.0 : p[2], k = schlick ? 0.0 : p[3];
        ux = 1.0 / ax, uy = 1.0 / ay, peak = 0.5 / (PI * ax * ay);
    }
};

inline Real metal(Real cos, Real n, Real k) {
    const Real cos2 = cos * cos, sin2 = 1.0 - cos2, d = n * n - k * k - sin2;
    const Real a2b2 = std::sqrt(d * d + 4.0 * n * n * k * k), a = std::sqrt(0.5 * (a2b2 + std::abs(d)));
    const Real re = d >= 0.0 ? a : n * k / a;
    const Real t = a2b2 + cos2, u = 2.0 * cos * re, v = cos2 * a2b2 + sin2 * sin2, w = u * sin2;
    const Real s = (t - u) / (t + u);
    return 0.5 * s * (1.0 + (v - w) / (v + w));
}

template <bool Schlick>
inline Real facets(Real xi, Real yi, Real zi, Real xr, Real yr, Real zr, const FacetSurface& s) {
    const Real hx = xi + xr, hy = yi + yr, hz = zi + zr, length2 = hx * hx + hy * hy + hz * hz;
    const Real tx = hx * s.ux, ty = hy * s.uy, q = hz * hz + tx * tx + ty * ty, u = 0.5 * std::sqrt(length2);
    const Real ix = s.ax * xi, iy = s.ay * yi, rx = s.ax * xr, ry = s.ay * yr;
    const Real reach_i = std::sqrt(zi * zi + ix * ix + iy * iy), reach_r = std::sqrt(zr * zr + rx * rx + ry * ry);
    const Real dx = xi - xr, dy = yi - yr, dz = zi - zr;
    const Real m = 0.25 * (dx * dx + dy * dy + dz * dz) / (1.0 + u), m2 = m * m;  // 1 - u with its digits
    const Real fresnel = Schlick ? s.f_0 + (1.0 - s.f_0) * m2 * m2 * m : metal(u, s.n, s.k);
    const Real lobe = fresnel * s.peak * length2 * length2 / (q * q * (zr * reach_i + zi * reach_r));
    return zi < 0.0 || zr < 0.0 ? 0.0 : s.diffuse + lobe;
}

// ---- Oren-Nayar, eqs (27) and (28)

struct OrenNayarSurface {
    Real scale, c1, ratio45, ratio125, bounced;
    explicit OrenNayarSurface(const Parameters& p) {
        const Real rho = p[0], s2 = p[1] * p[1], ratio = s2 / (s2 + 0.09);
        scale = rho / PI;
        c1 = 1.0 - 0.5 * s2 / (s2 + 0.33);
        ratio45 = 0.45 * ratio;
        ratio125 = 0.125 * ratio;
        bounced = p[2] * 0.17 * rho * s2 / (s2 + 0.13);
    }
};

inline Real oren_nayar(Real xi, Real yi, Real zi, Real xr, Real yr, Real zr, const OrenNayarSurface& s) {
    const Real sin_i = std::sqrt(xi * xi + yi * yi), sin_r = std::sqrt(xr * xr + yr * yr);
    const Real z_low = std::min(zi, zr), z_high = std::max(zi, zr);
    const Real alpha = std::acos(z_low), beta = std::acos(z_high);
    const Real sin_alpha = std::max(sin_i, sin_r), sin_beta = std::min(sin_i, sin_r);
    const Real cos_dphi = (xi * xr + yi * yr) / (sin_i * sin_r);
    const Real b = beta * (2.0 / PI), ab = alpha * beta * (4.0 / (PI * PI));
    const Real c2 = s.ratio45 * (sin_alpha - (cos_dphi >= 0.0 ? 0.0 : b * b * b));
    const Real direct = s.c1 + cos_dphi * c2 * (sin_beta / z_high) +
                          (1.0 - std::abs(cos_dphi)) * s.ratio125 * ab * ab * (sin_i + sin_r) / (zi + zr);
    const Real f = s.scale * (direct + s.bounced * (1.0 - cos_dphi * b * b));
    return zi < 0.0 || zr < 0.0 || f < 0.0 ? 0.0 : f;
}

// ---- Oren-Nayar, eq. (30)

struct QualitativeSurface {
    Real a, b;
    explicit QualitativeSurface(const Parameters& p) {
        const Real s2 = p[1] * p[1];
        a = p[0] / PI * (1.0 - 0.5 * s2 / (s2 + p[2]));
        b = p[0] / PI * 0.45 * s2 / (s2 + 0.09);
    }
};

// sin(alpha) tan(beta) cos(dphi) is the product of the horizontal parts over the larger cosine
inline Real qualitative(Real xi, Real yi, Real zi, Real xr, Real yr, Real zr,
                          const QualitativeSurface& s) {
    const Real f = s.a + s.b * std::max(0.0, xi * xr + yi * yr) / std::max(zi, zr);
    return zi < 0.0 || zr < 0.0 ? 0.0 : f;
}

// ---- RPV

struct RpvSurface {
    Real scale, power, one, twice, hot;
    explicit RpvSurface(const Parameters& p)
        : scale(p[0] / PI * (1.0 - p[2] * p[2])), power(p[1] - 1.0), one(1.0 + p[2] * p[2]), twice(2.0 * p[2]),
          hot(1.0 - p[3]) {}
};

inline Real rpv(Real xi, Real yi, Real zi, Real xr, Real yr, Real zr, const RpvSurface& s) {
    const Real q = s.one + s.twice * (xi * xr + yi * yr + zi * zr);
    const Real gx = xi / zi - xr / zr, gy = yi / zi - yr / zr, g = std::sqrt(gx * gx + gy * gy);
    const Real f = s.scale * std::pow(zi * zr * (zi + zr), s.power) / (q * std::sqrt(q)) * (1.0 + s.hot / (1.0 + g));
    return zi < 0.0 || zr < 0.0 ? 0.0 : f;
}

// ---- He-Torrance, eqs (71), (72), (75)-(84); the sum of (78) direction by direction until it has converged

struct Logs {
    std::vector<Real> of;
    explicit Logs(int count) : of(count) {
        for (int m = 1; m < count; ++m) of[m] = std::log(Real(m));
    }
};

// e^-g times the sum over m of g^m / (m! m) exp(-V / m); the coefficient by recurrence of its logarithm
Real series(Real g, Real V, Real tolerance) {
    static const Logs logs(1 << 20);
    const Real log_g = std::log(g);
    Real log_weight = log_g - g, sum = 0.0, previous = -std::numeric_limits<Real>::max();
    for (int m = 1; m + 1 < (1 << 20); ++m) {
        const Real log_term = log_weight - logs.of[m] - V / m;
        const Real term = std::exp(log_term);
        sum += term;
        if (log_term < previous && term <= tolerance * sum) break;
        previous = log_term;
        log_weight += log_g - logs.of[m + 1];
    }
    return sum;
}

Real shadowing(Real sin, Real cos, Real slope) {
    const Real x = cos / (2.0 * slope * sin), q = 1.0 - 0.5 * std::erfc(x);
    return q / (q + slope / std::sqrt(PI) * sin / cos * std::exp(-x * x));
}

Real hidden(Real sin, Real cos, Real slope) { return sin / cos * std::erfc(cos / (2.0 * slope * sin)); }

// W_0(y) by Halley's iteration
Real lambert_w(Real y) {
    Real w = std::log1p(y);
    for (int i = 0; i < 20; ++i) {
        const Real e = std::exp(w), f = w * e - y;
        const Real step = f / (e * (w + 1.0) - (w + 2.0) * f / (2.0 * w + 2.0));
        w -= step;
        if (std::abs(step) <= 1e-13 * w) break;
    }
    return w;
}

Real fresnel(Real cos, Real n, Real k) {
    const Real cos2 = cos * cos, sin2 = 1.0 - cos2, re = n * n - k * k - sin2, im = 2.0 * n * k;
    const Real modulus = std::sqrt(re * re + im * im);
    const Real a2 = 0.5 * (modulus + re), b2 = 0.5 * (modulus - re), a = std::sqrt(a2);
    const Real s = ((a - cos) * (a - cos) + b2) / ((a + cos) * (a + cos) + b2), t = sin2 / cos;
    return 0.5 * s * (1.0 + ((a - t) * (a - t) + b2) / ((a + t) * (a + t) + b2));
}

// p: wavelength [um], sigma_0, tau [um], n, k, a, tolerance
Real he_torrance(const Real* wi, const Real* wr, const Parameters& p) {
    const Real wave_number = 2.0 * PI / p[0], slope = p[1] / p[2];
    const Real ci = wi[2], cr = wr[2];
    const Real si = std::sqrt(wi[0] * wi[0] + wi[1] * wi[1]), sr = std::sqrt(wr[0] * wr[0] + wr[1] * wr[1]);
    const Real hx = wi[0] + wr[0], hy = wi[1] + wr[1], hz = ci + cr;
    const Real v_xy2 = hx * hx + hy * hy, v_z2 = hz * hz;
    const Real K = hidden(si, ci, slope) + hidden(sr, cr, slope);
    const Real sigma2 = p[1] * p[1] / (1.0 + lambert_w(K * K / (8.0 * PI)));
    const Real g = wave_number * wave_number * sigma2 * v_z2;
    const Real V = 0.25 * wave_number * wave_number * v_xy2 * p[2] * p[2];
    const Real D = wave_number * wave_number * p[2] * p[2] / 16.0 * series(g, V, p[6]);
    const Real G = (v_xy2 + v_z2) * (v_xy2 + v_z2) / v_z2;
    const Real S = shadowing(si, ci, slope) * shadowing(sr, cr, slope);
    const Real F2 = fresnel(0.5 * std::sqrt(v_xy2 + v_z2), p[3], p[4]);
    return F2 * G * S * D / (PI * ci * cr) + p[5] / PI;
}

// ---- Loops

struct Inputs {
    Array w_i, w_r, angles, theta, phi;  // angles: all of theta_i, then of phi_i, theta_r and phi_r
    std::vector<Array> parts;            // x_i y_i z_i x_r y_r z_r
    explicit Inputs(const std::string& folder)
        : w_i(read(folder + "/w_i")),
          w_r(read(folder + "/w_r")),
          angles(read(folder + "/angles")),
          theta(read(folder + "/theta")),
          phi(read(folder + "/phi")) {
        for (const Array* w : {&w_i, &w_r})
            for (int c = 0; c < 3; ++c) {
                parts.emplace_back(w->size / 3);
                for (std::size_t j = 0; j < w->size / 3; ++j) parts.back().data[j] = w->data[3 * j + c];
            }
    }
};

template <class Surface, class F>
void interleaved(const Inputs& in, const Surface& s, Real* __restrict f, F value) {
    const Real *__restrict a = in.w_i.data, *__restrict b = in.w_r.data;
    const std::size_t count = in.w_i.size / 3;
    for (std::size_t j = 0; j < count; ++j)
        f[j] = value(a[3 * j], a[3 * j + 1], a[3 * j + 2], b[3 * j], b[3 * j + 1], b[3 * j + 2], s);
}

template <class Surface, class F>
void six(const Inputs& in, const Surface& s, Real* __restrict f, F value) {
    const Real *__restrict xi = in.parts[0].data, *__restrict yi = in.parts[1].data,
                             *__restrict zi = in.parts[2].data, *__restrict xr = in.parts[3].data,
                             *__restrict yr = in.parts[4].data, *__restrict zr = in.parts[5].data;
    const std::size_t count = in.w_i.size / 3;
    for (std::size_t j = 0; j < count; ++j) f[j] = value(xi[j], yi[j], zi[j], xr[j], yr[j], zr[j], s);
}

template <class Surface, class F>
void by_angles(const Inputs& in, const Surface& s, Real* __restrict f, F value) {
    const std::size_t count = in.w_i.size / 3;
    const Real *__restrict ti = in.angles.data, *__restrict pi = ti + count, *__restrict tr = pi + count,
                             *__restrict pr = tr + count;
    for (std::size_t j = 0; j < count; ++j) {
        const Real si = std::sin(ti[j]), sr = std::sin(tr[j]);
        f[j] = value(si * std::cos(pi[j]), si * std::sin(pi[j]), std::cos(ti[j]), sr * std::cos(pr[j]),
                     sr * std::sin(pr[j]), std::cos(tr[j]), s);
    }
}

const auto ward_value = [](Real xi, Real yi, Real zi, Real xr, Real yr, Real zr, const WardSurface& s) {
    return ward(xi, yi, zi, xr, yr, zr, s.diffuse, s.peak, s.ux, s.uy);
};
const auto metal_value = [](Real xi, Real yi, Real zi, Real xr, Real yr, Real zr, const FacetSurface& s) {
    return facets<false>(xi, yi, zi, xr, yr, zr, s);
};
const auto schlick_value = [](Real xi, Real yi, Real zi, Real xr, Real yr, Real zr, const FacetSurface& s) {
    return facets<true>(xi, yi, zi, xr, yr, zr, s);
};
const auto oren_nayar_value = [](Real xi, Real yi, Real zi, Real xr, Real yr, Real zr,
                                 const OrenNayarSurface& s) { return oren_nayar(xi, yi, zi, xr, yr, zr, s); };
const auto qualitative_value = [](Real xi, Real yi, Real zi, Real xr, Real yr, Real zr,
                                  const QualitativeSurface& s) { return qualitative(xi, yi, zi, xr, yr, zr, s); };

const auto rpv_value = [](Real xi, Real yi, Real zi, Real xr, Real yr, Real zr, const RpvSurface& s) {
    return rpv(xi, yi, zi, xr, yr, zr, s);
};

// theta_i x theta_r x delta_phi from axes; what does not depend on the azimuth is outside the innermost loop
struct Axes {
    std::size_t polar, azimuths;
    std::vector<Real> sin, cos, cos_phi, sin_phi;
    explicit Axes(const Inputs& in)
        : polar(in.theta.size), azimuths(in.phi.size), sin(polar), cos(polar), cos_phi(azimuths), sin_phi(azimuths) {
        for (std::size_t i = 0; i < polar; ++i) sin[i] = std::sin(in.theta.data[i]), cos[i] = std::cos(in.theta.data[i]);
        for (std::size_t j = 0; j < azimuths; ++j)
            cos_phi[j] = std::cos(in.phi.data[j]), sin_phi[j] = std::sin(in.phi.data[j]);
    }
};

void ward_grid(const Inputs& in, const Parameters& p, Real* __restrict f) {
    const Axes axes(in);
    const WardSurface s(p);
    const Real *__restrict c = axes.cos_phi.data(), *__restrict d = axes.sin_phi.data();
    for (std::size_t i = 0; i < axes.polar; ++i)
        for (std::size_t r = 0; r < axes.polar; ++r, f += axes.azimuths) {
            const Real hz = axes.cos[i] + axes.cos[r], inverse = 1.0 / hz;
            const Real fixed = axes.sin[i] * s.ux * inverse;
            const Real x = axes.sin[r] * s.ux * inverse, y = axes.sin[r] * s.uy * inverse;
            const Real peak = s.peak / std::sqrt(axes.cos[i] * axes.cos[r]);
            for (std::size_t j = 0; j < axes.azimuths; ++j) {
                const Real hx = fixed + x * c[j], hy = y * d[j];
                f[j] = s.diffuse + peak * std::exp(-(hx * hx + hy * hy));
            }
        }
}

template <bool Schlick>
void facets_grid(const Inputs& in, const Parameters& p, Real* __restrict f) {
    const Axes axes(in);
    const FacetSurface s(p, Schlick);
    const Real *__restrict c = axes.cos_phi.data(), *__restrict d = axes.sin_phi.data();
    for (std::size_t i = 0; i < axes.polar; ++i)
        for (std::size_t r = 0; r < axes.polar; ++r, f += axes.azimuths)
            for (std::size_t j = 0; j < axes.azimuths; ++j)
                f[j] = facets<Schlick>(axes.sin[i], 0.0, axes.cos[i], axes.sin[r] * c[j], axes.sin[r] * d[j],
                                       axes.cos[r], s);
}

void oren_nayar_grid(const Inputs& in, const Parameters& p, Real* __restrict f) {
    const Axes axes(in);
    const OrenNayarSurface s(p);
    const Real* __restrict c = axes.cos_phi.data();
    for (std::size_t i = 0; i < axes.polar; ++i)
        for (std::size_t r = 0; r < axes.polar; ++r, f += axes.azimuths) {
            const Real alpha = std::max(in.theta.data[i], in.theta.data[r]);
            const Real beta = std::min(in.theta.data[i], in.theta.data[r]);
            const Real b = beta * (2.0 / PI), ab = alpha * beta * (4.0 / (PI * PI)), tan_beta = std::tan(beta);
            const Real sin_alpha = std::max(axes.sin[i], axes.sin[r]), bounced = s.scale * s.bounced;
            const Real level = s.scale * s.c1 + bounced;
            const Real backward = s.scale * s.ratio45 * sin_alpha * tan_beta - bounced * b * b;
            const Real forward = backward - s.scale * s.ratio45 * b * b * b * tan_beta;
            const Real third = s.scale * s.ratio125 * ab * ab * std::tan(0.5 * (alpha + beta));
            for (std::size_t j = 0; j < axes.azimuths; ++j) {
                const Real value =
                    level + (c[j] >= 0.0 ? backward : forward) * c[j] + third * (1.0 - std::abs(c[j]));
                f[j] = std::max(0.0, value);
            }
        }
}

void qualitative_grid(const Inputs& in, const Parameters& p, Real* __restrict f) {
    const Axes axes(in);
    const QualitativeSurface s(p);
    const Real* __restrict c = axes.cos_phi.data();
    for (std::size_t i = 0; i < axes.polar; ++i)
        for (std::size_t r = 0; r < axes.polar; ++r, f += axes.azimuths) {
            const Real b = s.b * std::max(axes.sin[i], axes.sin[r]) *
                             std::tan(std::min(in.theta.data[i], in.theta.data[r]));
            for (std::size_t j = 0; j < axes.azimuths; ++j) f[j] = s.a + b * std::max(0.0, c[j]);
        }
}

void rpv_grid(const Inputs& in, const Parameters& p, Real* __restrict f) {
    const Axes axes(in);
    const RpvSurface s(p);
    const Real* __restrict c = axes.cos_phi.data();
    for (std::size_t i = 0; i < axes.polar; ++i)
        for (std::size_t r = 0; r < axes.polar; ++r, f += axes.azimuths) {
            const Real zi = axes.cos[i], zr = axes.cos[r], ti = axes.sin[i] / zi, tr = axes.sin[r] / zr;
            const Real level = s.scale * std::pow(zi * zr * (zi + zr), s.power);
            const Real q = s.one + s.twice * zi * zr, across = s.twice * axes.sin[i] * axes.sin[r];
            const Real squares = ti * ti + tr * tr, product = 2.0 * ti * tr;
            for (std::size_t j = 0; j < axes.azimuths; ++j) {
                const Real phase = q + across * c[j];
                const Real g = std::sqrt(std::max(0.0, squares - product * c[j]));
                f[j] = level / (phase * std::sqrt(phase)) * (1.0 + s.hot / (1.0 + g));
            }
        }
}

double processor_seconds() {
    timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return now.tv_sec + now.tv_nsec / double(1000000000);
}

using Kernel = std::function<void(const Inputs&, const Parameters&, Real*)>;

// Random directions of one model, as they are laid out, and its grid
template <class Surface, class F>
void add(std::map<std::string, Kernel>& all, const std::string& name, Surface surface, F value, Kernel grid) {
    all[name] = [=](const Inputs& in, const Parameters& p, Real* f) { interleaved(in, surface(p), f, value); };
    all[name + "_six"] = [=](const Inputs& in, const Parameters& p, Real* f) { six(in, surface(p), f, value); };
    all[name + "_angles"] = [=](const Inputs& in, const Parameters& p, Real* f) { by_angles(in, surface(p), f, value); };
    all[name + "_grid"] = grid;
}

std::map<std::string, Kernel> kernels() {
    std::map<std::string, Kernel> all;
    add(all, "ward", [](const Parameters& p) { return WardSurface(p); }, ward_value, ward_grid);
    add(all, "ggx", [](const Parameters& p) { return FacetSurface(p, false); }, metal_value, facets_grid<false>);
    add(all, "ggx_schlick", [](const Parameters& p) { return FacetSurface(p, true); }, schlick_value, facets_grid<true>);
    add(all, "oren_nayar", [](const Parameters& p) { return OrenNayarSurface(p); }, oren_nayar_value, oren_nayar_grid);
    add(all, "oren_nayar_qualitative", [](const Parameters& p) { return QualitativeSurface(p); }, qualitative_value,
        qualitative_grid);
    add(all, "rpv", [](const Parameters& p) { return RpvSurface(p); }, rpv_value, rpv_grid);
    // the first p.back() directions only
    all["he_torrance"] = [](const Inputs& in, const Parameters& p, Real* f) {
        for (std::size_t j = 0; j < std::size_t(p.back()); ++j)
            f[j] = he_torrance(in.w_i.data + 3 * j, in.w_r.data + 3 * j, p);
    };
    return all;
}

}  // namespace

int main(int, char** arguments) {
    using Clock = std::chrono::steady_clock;
    const Inputs inputs(arguments[1]);
    const std::map<std::string, Kernel> all = kernels();
    Array values(std::max(inputs.w_i.size / 3, inputs.theta.size * inputs.theta.size * inputs.phi.size));
    for (std::string line; std::getline(std::cin, line);) {
        std::istringstream words(line);
        std::string verb, name, argument;
        words >> verb >> name >> argument;
        Parameters p;
        for (double value; words >> value;) p.push_back(value);
        const Kernel& kernel = all.at(name);
        kernel(inputs, p, values.data);  // the first pass warms the caches
        if (verb == "dump") {
            std::ofstream(argument, std::ios::binary)
                .write(reinterpret_cast<const char*>(values.data), values.size * sizeof(Real));
            std::cout << "done" << std::endl;
            continue;
        }
        std::vector<double> seconds;
        for (const auto start = Clock::now();
             seconds.size() < 3 || std::chrono::duration<double>(Clock::now() - start).count() < std::stod(argument);) {
            const double before = processor_seconds();
            kernel(inputs, p, values.data);
            seconds.push_back(processor_seconds() - before);
        }
        std::sort(seconds.begin(), seconds.end());
        std::cout << seconds[seconds.size() / 2] << " " << seconds[0] << std::endl;
    }
}
