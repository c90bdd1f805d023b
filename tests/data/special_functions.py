"""Reference values of special functions, from mpmath at 50 digits: python special_functions.py > special_functions.json"""
import json
import mpmath as mp

mp.mp.dps = 50


def root(f, low, high):
    """Bisection on a monotone function; slow, safe, 45 digits."""
    low, high = mp.mpf(low), mp.mpf(high)
    for _ in range(400):
        middle = (low + high) / 2
        low, high = (middle, high) if f(middle) < 0 else (low, middle)
    return (low + high) / 2


def chi2_cdf(x, k): return mp.gammainc(mp.mpf(k) / 2, 0, mp.mpf(x) / 2, regularized=True)
def chi2_sf(x, k): return mp.gammainc(mp.mpf(k) / 2, mp.mpf(x) / 2, mp.inf, regularized=True)
def beta_i(a, b, x): return mp.betainc(a, b, 0, x, regularized=True)


def t_cdf(t, v):
    t, v = mp.mpf(t), mp.mpf(v)
    tail = beta_i(v / 2, mp.mpf(1) / 2, v / (v + t * t)) / 2
    return 1 - tail if t > 0 else tail


F = lambda value: float(value)
P = [1e-6, 0.005, 0.025, 0.3, 0.5, 0.61, 0.95, 0.995]
K = [1, 2, 3, 9, 24, 49, 400]
X = ["0.01", "0.5", "1", "1.5", "2.25", "7", "14.9", "24.5", "150", "3000"]
out = {
    "ln_gamma": [[float(x), F(mp.loggamma(mp.mpf(x)))] for x in X],
    "digamma": [[float(x), F(mp.digamma(mp.mpf(float(x))))] for x in X],
    "trigamma": [[float(x), F(mp.psi(1, mp.mpf(float(x))))] for x in X],
    "normal_cdf": [[x, F(mp.ncdf(x))] for x in (-36.0, -8.0, -3.0, -0.5, 0.0, 0.3, 2.0, 6.0)],
    "normal_ln_cdf": [[x, F(mp.log(mp.erfc(-mp.mpf(x) / mp.sqrt(2)) / 2))] for x in (-200.0, -31.0, -29.0, -5.0, 0.0, 3.0)],
    "normal_quantile": [[p, F(root(lambda x: mp.ncdf(x) - mp.mpf(p), -20, 20))] for p in (1e-30, 1e-10, 0.001, 0.025, 0.08, 0.4, 0.7, 0.975, 0.999999)],
    "chi2_cdf": [[x, k, F(chi2_cdf(x, k))] for k in K for x in (0.01, 1.0, 10.0, 60.0, 500.0)],
    "chi2_sf": [[x, k, F(chi2_sf(x, k))] for k in K for x in (0.01, 1.0, 10.0, 60.0, 500.0)],
    "chi2_quantile": [[p, k, F(root(lambda x: chi2_cdf(x, k) - mp.mpf(p), 0, 2000))] for k in K for p in P],
    "student_t_cdf": [[t, v, F(t_cdf(t, v))] for v in K for t in (-40.0, -2.0, -0.1, 0.7, 3.0)],
    "student_t_quantile": [[p, v, F(root(lambda t: t_cdf(t, v) - mp.mpf(p), -4e5, 4e5))] for v in K for p in P if p != 0.5],
    "beta_i": [[a, b, x, F(beta_i(a, b, mp.mpf(x)))] for a, b in ((0.5, 0.5), (1.0, 3.0), (24.5, 0.5), (3.0, 48.0), (950.0, 51.0)) for x in (1e-6, 0.03, 0.5, 0.94, 0.9999)],
    "beta_quantile": [[p, a, b, F(root(lambda x: beta_i(a, b, x) - mp.mpf(p), 0, 1))] for a, b in ((1.0, 20.0), (3.0, 48.0), (19.0, 2.0), (950.0, 51.0), (0.5, 4.5)) for p in (0.025, 0.5, 0.975)],
}
print(json.dumps({"source": f"mpmath {mp.__version__}, 50 digits", **out}, separators=(",", ":")))
