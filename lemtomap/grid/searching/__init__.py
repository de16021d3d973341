"""Looking for a pose where the guess is poor: up the hill of closeness, or all round."""
