"""A local web page on which a model plans under the oracle's eyes: `service` answers, `server` speaks HTTP."""
