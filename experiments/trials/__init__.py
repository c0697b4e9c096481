"""The trainings of the trial, the comparison and the readings: what one is, its rate, and how it is made and kept."""
