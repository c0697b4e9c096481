"""Results with their provenance, numbers as they are printed, and the ledger of claims."""
