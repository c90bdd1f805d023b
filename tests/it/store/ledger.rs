//! Ledgers: nothing that was appended is lost or doubled, nothing damaged is believed.

use super::{Entry, Place, entries, entry, files, flip_a_bit, key, open, other, truncate};
use granulake::canonical::Digest;
use granulake::store::StoreError;
use granulake::store::ledger::{FOLD_AT, SMALL};
use granulake::tables::io;
use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

#[test]
fn a_journal_survives_without_compaction_and_compaction_changes_no_row() {
    let place = Place::new();
    let store = place.store();
    let ledger = open(&store);
    for number in 0..20 {
        ledger.append(&entry(number)).unwrap();
    }
    let (keys, rows) = (ledger.keys(), ledger.rows().collect::<Vec<_>>());
    assert!(keys.is_sorted() && keys.len() == 20 && rows.len() == 40);
    assert_eq!((place.parts().len(), place.journal().len()), (0, 20));
    drop((ledger, store));

    let store = place.store();
    let ledger = open(&store);
    assert_eq!(ledger.rows().collect::<Vec<_>>(), rows);
    assert_eq!(ledger.get(&key(3).to_string()), Some(entry(3)));
    assert_eq!(ledger.get(&key(99).to_string()), None);
    assert_eq!(ledger.get("no key"), None);
    ledger.compact().unwrap();
    assert_eq!((place.parts().len(), place.journal().len()), (1, 0));
    assert_eq!(ledger.rows().collect::<Vec<_>>(), rows);
    drop((ledger, store));
    let ledger = open(&place.store());
    assert_eq!(ledger.rows().collect::<Vec<_>>(), rows);
    assert_eq!(ledger.warnings(), []);
}

#[test]
fn the_files_after_compaction_do_not_tell_how_the_rows_came_in() {
    let (one, two) = (Place::new(), Place::new());
    let store = one.store();
    let ledger = open(&store);
    ledger.append(&entries(0..50)).unwrap();
    ledger.compact().unwrap();

    let store = two.store();
    let ledger = open(&store);
    for number in (0..25).rev() {
        ledger.append(&entry(number)).unwrap();
    }
    ledger.compact().unwrap();
    ledger.replace(&[Entry { value: Some(-1.0), ..entry(30)[0].clone() }]).unwrap();
    ledger.replace(&entries(25..50)).unwrap();
    ledger.compact().unwrap();

    let content = |place: &Place| {
        let snapshot = place.snapshot().into_iter();
        snapshot.map(|(path, bytes)| (path.strip_prefix(&place.root).unwrap().to_owned(), bytes)).collect::<Vec<_>>()
    };
    assert_eq!(content(&one), content(&two));
    let before = one.snapshot();
    open(&one.store()).compact().unwrap();
    assert_eq!(one.snapshot(), before);
}

#[test]
fn a_large_part_stays_until_a_quarter_as_many_keys_have_come_after_it() {
    let place = Place::new();
    let store = place.store();
    let ledger = open(&store);
    let large = SMALL as u64 + 10;
    ledger.append(&entries(0..large)).unwrap();
    ledger.compact().unwrap();
    let first = place.parts();
    let add = |keys: std::ops::Range<u64>| {
        ledger.append(&entries(keys)).unwrap();
        ledger.compact().unwrap();
        (place.parts().len(), first.iter().all(|path| path.exists()))
    };
    assert_eq!((first.len(), add(large..large + 10)), (1, (2, true)));
    assert_eq!(add(large + 10..large + 20), (2, true), "small parts are merged");
    drop(ledger);
    let ledger = open(&store);
    assert_eq!((ledger.len() as u64, ledger.warnings()), (large + 20, vec![]));
    let last = [5, large + 15].map(|number| ledger.get(&key(number).to_string()));
    assert_eq!(last, [Some(entry(5)), Some(entry(large + 15))]);
    ledger.append(&entries(large + 20..large + large / 4 + 1)).unwrap();
    ledger.compact().unwrap();
    assert_eq!((place.parts().len(), ledger.len() as u64), (1, large + large / 4 + 1));
}

#[test]
fn a_long_journal_is_folded_without_rewriting_the_parts() {
    let place = Place::new();
    let store = place.store();
    let ledger = open(&store);
    let n = 2 * FOLD_AT as u64 + 10;
    for number in 0..n {
        ledger.append(&entry(number)).unwrap();
    }
    assert_eq!((place.parts().len(), place.journal().len()), (2, 10));
    assert_eq!(ledger.rows().count() as u64, 2 * n);
    drop((ledger, store));
    let store = place.store();
    let ledger = open(&store);
    assert_eq!((ledger.len() as u64, ledger.warnings()), (n, vec![]));
    ledger.compact().unwrap();
    assert_eq!((place.parts().len(), place.journal().len()), (1, 0));
    assert_eq!(ledger.len() as u64, n);
}

#[test]
fn the_same_rows_again_are_no_news_and_other_rows_are_nondeterminism() {
    let place = Place::new();
    let store = place.store();
    let ledger = open(&store);
    ledger.append(&entries(0..3)).unwrap();
    let before = place.snapshot();
    ledger.append(&entry(1)).unwrap();
    assert_eq!(place.snapshot(), before);

    // Minus zero equals zero as a number, but its bytes differ.
    ledger.append(&[Entry { value: Some(0.0), ..entry(7)[0].clone() }]).unwrap();
    let negative = [Entry { value: Some(-0.0), ..entry(7)[0].clone() }];
    let error = ledger.append(&negative).unwrap_err();
    let StoreError::Nondeterminism(contradiction) = &error else { panic!("{error}") };
    let kept = io::read_table::<Entry>(&contradiction.kept).unwrap();
    assert!(kept[0].value.unwrap().is_sign_negative());
    assert_eq!(contradiction.offered, Digest::of_content(&fs::read(&contradiction.kept).unwrap()));
    let text = error.to_string();
    for digest in [contradiction.key, contradiction.stored, contradiction.offered] {
        assert!(text.contains(&digest.to_string()), "{text}");
    }
    assert!(ledger.get(&key(7).to_string()).unwrap()[0].value.unwrap().is_sign_positive());

    // Fewer rows of a key are other rows too; nothing of the refused call is stored.
    let mixed = [entry(1)[..1].to_vec(), entry(50)].concat();
    assert!(matches!(ledger.append(&mixed), Err(StoreError::Nondeterminism(_))));
    assert!(!ledger.contains(&key(50)));
    let bad = Entry { key: "run 1".into(), ..entry(1)[0].clone() };
    assert!(ledger.append(&[bad]).unwrap_err().to_string().contains("`run 1` is not a key"));
}

#[test]
fn replaced_rows_count_from_then_on() {
    let place = Place::new();
    let store = place.store();
    let ledger = open(&store);
    let failed = vec![Entry { value: None, ..entry(1)[0].clone() }];
    ledger.append(&failed).unwrap();
    ledger.append(&entry(2)).unwrap();
    ledger.compact().unwrap();
    let part = place.snapshot();
    ledger.replace(&entry(1)).unwrap();
    assert_eq!(ledger.get(&key(1).to_string()), Some(entry(1)));
    drop((ledger, store));
    assert_eq!(open(&place.store()).get(&key(1).to_string()), Some(entry(1)));
    assert!(part.iter().all(|(path, bytes)| fs::read(path).unwrap() == *bytes), "a part is never edited");
    let store = place.store();
    let ledger = open(&store);
    ledger.compact().unwrap();
    assert_eq!((ledger.get(&key(1).to_string()), ledger.len()), (Some(entry(1)), 2));
}

#[test]
fn a_crash_between_any_two_steps_of_a_compaction_loses_and_doubles_nothing() {
    let place = Place::new();
    {
        let store = place.store();
        let ledger = open(&store);
        ledger.append(&entries(0..10)).unwrap();
        ledger.compact().unwrap();
        for number in 10..16 {
            ledger.append(&entry(number)).unwrap();
        }
        // One key of the part and one of the journal, whose older rows must not come back.
        let replaced = [3, 12].map(|number| Entry { value: Some(0.5), ..entry(number)[0].clone() });
        ledger.replace(&replaced).unwrap();
    }
    let before = place.snapshot();
    let wanted: Vec<_> = open(&place.store()).rows().collect();
    open(&place.store()).compact().unwrap();
    let after = place.snapshot();

    // Steps: new part, manifest, then old files one by one. The manifest of the moment after the rename still says how
    // far the journal was folded; the last step resets that.
    let manifest = place.ledger_folder().join("manifest.json");
    let new_part = after.keys().find(|path| !before.contains_key(*path)).unwrap().clone();
    let renamed = String::from_utf8(after[&manifest].clone()).unwrap().replace("\"folded\": 0", "\"folded\": 7");
    assert_ne!(renamed.as_bytes(), after[&manifest]);
    let old: Vec<_> = before.keys().filter(|path| !after.contains_key(*path)).cloned().collect();
    assert_eq!(old.len(), 8, "one part and seven journal files");

    let mut states = vec![before.clone()];
    let mut state = before;
    state.insert(new_part.with_file_name(".tmp-1-1"), after[&new_part][..40].to_vec());
    states.push(state.clone());
    state.insert(new_part.clone(), after[&new_part].clone());
    states.push(state.clone());
    state.insert(manifest, renamed.into_bytes());
    states.push(state.clone());
    for path in old.iter().chain(old.iter().rev()) {
        let mut partly = state.clone();
        partly.remove(path);
        states.push(partly);
    }
    for path in &old {
        state.remove(path);
        states.push(state.clone());
    }
    for (number, state) in states.iter().enumerate() {
        place.restore(state);
        let ledger = open(&place.store());
        assert_eq!(ledger.rows().collect::<Vec<_>>(), wanted, "state {number}");
        assert_eq!(ledger.warnings(), [], "state {number}");
        drop(ledger);
        open(&place.store()).compact().unwrap();
        let mut end = place.snapshot();
        end.retain(|path, _| !path.file_name().unwrap().to_str().unwrap().starts_with(".tmp-"));
        assert_eq!(end, after, "state {number}");
    }
}

#[test]
fn damaged_journal_files_are_set_aside_and_their_keys_are_missing() {
    for damage in [truncate, flip_a_bit] {
        let place = Place::new();
        {
            let ledger = open(&place.store());
            (0..3).for_each(|number| ledger.append(&entry(number)).unwrap());
        }
        damage(&place.journal()[1]);
        let reader = open(&place.store());
        assert_eq!((reader.len(), reader.warnings().len(), place.journal().len()), (2, 1, 3));

        let store = place.store();
        store.claim().unwrap();
        let ledger = open(&store);
        let warning = ledger.warnings()[0].to_string();
        assert!(warning.contains("is truncated or altered; its keys count as missing, it was moved to"), "{warning}");
        assert!(!ledger.contains(&key(1)));
        assert_eq!(files(&place.root.join("quarantine"), "").len(), 1);
        ledger.append(&entry(1)).unwrap();
        ledger.compact().unwrap();
        assert_eq!(ledger.rows().count(), 6);
        drop((ledger, store));
        assert_eq!(open(&place.store()).warnings(), []);
    }
}

#[test]
fn damaged_or_missing_parts_and_manifests_are_reported_and_healed() {
    let remove: fn(&Path) = |path| fs::remove_file(path).unwrap();
    for (damage, manifest_too) in
        [(truncate as fn(&Path), false), (flip_a_bit, false), (remove, false), (truncate, true)]
    {
        let place = Place::new();
        {
            let ledger = open(&place.store());
            ledger.append(&entries(0..4)).unwrap();
            ledger.compact().unwrap();
            ledger.append(&entry(4)).unwrap();
        }
        if manifest_too {
            damage(&place.ledger_folder().join("manifest.json"));
        } else {
            damage(&place.parts()[0]);
        }
        let store = place.store();
        store.claim().unwrap();
        let ledger = open(&store);
        assert_eq!(ledger.warnings().len(), 1);
        assert_eq!(ledger.len(), if manifest_too { 5 } else { 1 });
        ledger.append(&entries(0..5)).unwrap();
        ledger.compact().unwrap();
        drop((ledger, store));
        let ledger = open(&place.store());
        assert_eq!((ledger.len(), ledger.rows().count(), ledger.warnings()), (5, 10, vec![]));
    }
}

fn later(number: u64) -> other::Later {
    other::Later { key: key(number).to_string() }
}

#[test]
fn rows_of_a_later_schema_version_are_an_error_and_stay_where_they_are() {
    let place = Place::new();
    place.store().ledger::<other::Later>("entries").unwrap().append(&[later(1)]).unwrap();
    let before = place.snapshot();
    let error = place.store().ledger::<Entry>("entries").unwrap_err().to_string();
    assert!(error.contains("schema version 2, this program reads 1") && error.contains("journal"), "{error}");
    assert_eq!(place.snapshot(), before);
}

/// A reader passes them over, a writer sets them aside and goes on; what is appended then is found again.
#[test]
fn rows_of_an_earlier_schema_version_count_as_missing_and_are_kept_in_quarantine() {
    for compacted in [false, true] {
        let place = Place::new();
        let earlier = open(&place.store());
        earlier.append(&entry(1)).unwrap();
        if compacted {
            earlier.compact().unwrap();
        }
        drop(earlier);
        let before = place.snapshot();
        let store = place.store();
        let ledger = store.ledger::<other::Later>("entries").unwrap();
        assert!(ledger.is_empty() && ledger.warnings()[0].what.contains("earlier version"), "{:?}", ledger.warnings());
        assert_eq!(place.snapshot(), before, "a reader moves nothing");
        ledger.append(&[later(1)]).unwrap();
        ledger.compact().unwrap();
        drop((ledger, store));
        let ledger = place.store().ledger::<other::Later>("entries").unwrap();
        assert_eq!((ledger.rows().collect::<Vec<_>>(), ledger.warnings()), (vec![later(1)], vec![]));
        assert_eq!(
            place.snapshot().iter().filter(|(path, _)| path.to_string_lossy().contains("quarantine")).count(),
            1
        );
    }
}

#[test]
fn threads_append_at_the_same_time() {
    let place = Place::new();
    let store = place.store();
    let ledger = open(&store);
    std::thread::scope(|scope| {
        for thread in 0..8 {
            let ledger = &ledger;
            scope.spawn(move || {
                for number in 0..40 {
                    // Every key comes from two threads; key 1000 in versions that contradict each other.
                    ledger.append(&entry(thread / 2 * 40 + number)).unwrap();
                }
            });
        }
    });
    let contradictions: usize = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..8)
            .map(|thread| {
                let (ledger, row) = (&ledger, Entry { value: Some(f64::from(thread)), ..entry(1000)[0].clone() });
                scope.spawn(move || usize::from(ledger.append(&[row]).is_err()))
            })
            .collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).sum()
    });
    assert_eq!((ledger.len(), contradictions), (161, 7));
    let rows: Vec<_> = ledger.rows().collect();
    drop((ledger, store));
    let ledger = open(&place.store());
    assert_eq!(ledger.rows().collect::<Vec<_>>(), rows);
    assert!((0..160).all(|number| ledger.get(&key(number).to_string()) == Some(entry(number))));
}

#[test]
fn a_reader_never_sees_less_while_a_writer_compacts() {
    let place = Place::new();
    let store = place.store();
    let ledger = open(&store);
    ledger.append(&entries(0..20)).unwrap();
    let finished = AtomicBool::new(false);
    std::thread::scope(|scope| {
        for _ in 0..3 {
            scope.spawn(|| {
                let reader = place.store();
                let mut seen = 20;
                while !finished.load(Ordering::Relaxed) {
                    let ledger = open(&reader);
                    assert!(ledger.len() >= seen, "{} after {seen}", ledger.len());
                    assert_eq!(ledger.warnings(), []);
                    seen = ledger.len();
                }
            });
        }
        for number in 20..60 {
            ledger.append(&entry(number)).unwrap();
            ledger.compact().unwrap();
        }
        finished.store(true, Ordering::Relaxed);
    });
}
