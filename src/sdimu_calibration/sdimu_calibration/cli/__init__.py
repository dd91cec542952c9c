"""The command line `sdimu`: arguments in one file per verb, work elsewhere."""
