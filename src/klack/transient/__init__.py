"""Full-order transient contact, the reference that every reduction is compared with."""
