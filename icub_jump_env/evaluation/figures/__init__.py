"""All pictures; only these modules know matplotlib."""
