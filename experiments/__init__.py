"""What remakes the evidence in the documents: trainings, rivals, frontier, ablations."""
