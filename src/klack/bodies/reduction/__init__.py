"""Modal reduction of elastic bodies with static correction at their ports."""
