"""Fits: likelihoods, priors, steps, answers."""
