"""The plan: what is done for a scene, worked out once from its records and the user's choices.

`registry` has every choice, `choices` what a user asks for, `inspection` and `features` what a scene uses,
`auto` and `refusals` the rules, `plan` what follows; `in_force` and `description` say it.  Pure: no device,
no table of a scene's values.
"""
