"""Contact: mortar spaces, complementarity, static ladders, local laws, restitution."""
