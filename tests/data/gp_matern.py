"""Reference values of a Gaussian process with a Matern 5/2 kernel, from scikit-learn: python gp_matern.py > gp_matern.json"""
import json
import numpy as np
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

rng = np.random.default_rng(52)
X = np.round(rng.random((40, 3)), 6)
y = np.round(np.sin(4 * X[:, 0]) + X[:, 1] * X[:, 2] + 0.1 * rng.standard_normal(40), 6)
noise = np.round(0.002 + 0.02 * X[:, 1], 6)
test = np.round(rng.random((10, 3)), 6)

cases = []
for log10_a, variance in [([0.4, -0.2, 0.1], 2.5), ([-1.0, -1.0, -1.0], 30.0), ([1.0, 0.6, -0.5], 0.7)]:
    length = 10 ** (-0.5 * np.array(log10_a))
    kernel = ConstantKernel(variance) * Matern(length_scale=length, nu=2.5)
    process = GaussianProcessRegressor(kernel, alpha=noise, optimizer=None).fit(X, y)
    value, gradient = process.log_marginal_likelihood(process.kernel_.theta, eval_gradient=True)
    mean, sd = process.predict(test, return_std=True)
    # theta is (ln variance, ln length); log10 a = -2 log10 length.
    per_decade = np.append(-0.5 * np.log(10) * gradient[1:], np.log(10) * gradient[0])
    cases.append({
        "log10_a": log10_a, "variance": variance, "lml": value, "grad_lml": per_decade.tolist(),
        "mean": mean.tolist(), "latent_var": (sd**2).tolist(),
    })
print(json.dumps({"X": X.tolist(), "y": y.tolist(), "noise": noise.tolist(), "X_test": test.tolist(), "cases": cases}))
