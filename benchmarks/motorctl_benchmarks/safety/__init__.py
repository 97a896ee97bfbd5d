"""The campaign of the guards: faults to order in every state, and hours without any."""
