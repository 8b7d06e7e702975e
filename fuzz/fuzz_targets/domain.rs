//! Any bytes as a domain: read or refused, and what is read prints back to an equal tree.
#![no_main]

use libfuzzer_sys::fuzz_target;
use strips_core::pddl::{Source, parse_domain, print_domain};

fuzz_target!(|bytes: &[u8]| {
    let Ok(source) = Source::from_bytes("domain", bytes.to_vec()) else { return };
    match parse_domain(&source) {
        Ok(mut domain) => {
            let mut again = parse_domain(&Source::new("printed", print_domain(&domain))).expect("it was just printed");
            domain.warnings.clear();
            again.warnings.clear();
            assert_eq!(domain, again);
        }
        Err(error) => assert!(error.to_string().starts_with("domain:")),
    }
});
