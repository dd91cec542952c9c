"""How probable is each set of effects and noise: one number for each model, and the models near the best."""
