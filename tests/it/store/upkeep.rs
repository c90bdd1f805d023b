//! Objects, the claim, the lock file, fsck and gc.

use super::{Place, entries, entry, flip_a_bit, key, open, truncate};
use granulake::canonical::Digest;
use granulake::store::fsck::{self, Depth, Problem};
use granulake::store::gc::{self, Kind};
use granulake::store::{Lock, Output, StageLock, Store, StoreError};
use granulake::tables::io::to_parquet_bytes;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;

#[test]
fn objects_are_checked_on_the_way_out_and_healed_on_the_way_in() {
    let place = Place::new();
    let store = place.store();
    let digest = store.put_object(b"state").unwrap();
    assert_eq!(store.put_object(b"state").unwrap(), digest);
    assert_eq!(store.object(&digest).unwrap(), b"state");
    flip_a_bit(&store.object_path(&digest));
    let error = store.object(&digest).unwrap_err();
    assert!(matches!(error, StoreError::WrongDigest { .. }) && error.to_string().contains("run `fsck`"), "{error}");
    store.put_object(b"state").unwrap();
    assert_eq!(store.object(&digest).unwrap(), b"state");
    let missing = store.object(&key(1)).unwrap_err();
    assert!(matches!(missing, StoreError::MissingObject { .. }), "{missing}");
}

#[test]
fn only_one_store_writes_and_readers_do_not_mind() {
    let place = Place::new();
    let first = place.store();
    first.claim().unwrap();
    open(&first).append(&entry(1)).unwrap();
    let second = place.store();
    assert_eq!(open(&second).get(&key(1).to_string()), Some(entry(1)));
    let busy = second.put_object(b"x").unwrap_err();
    assert!(matches!(busy, StoreError::Busy { .. }), "{busy}");
    assert!(busy.to_string().contains(&format!("process {}", std::process::id())), "{busy}");
    assert!(matches!(open(&second).append(&entry(2)), Err(StoreError::Busy { .. })));
    let clone = first.clone();
    drop(first);
    assert!(second.claim().is_err(), "a clone still has the claim");
    drop(clone);
    second.claim().unwrap();
}

#[test]
fn a_ledger_opened_before_the_claim_sees_what_was_written_until_then() {
    let place = Place::new();
    let late = place.store();
    let ledger = open(&late);
    {
        let early = place.store();
        let ledger = open(&early);
        ledger.append(&entries(0..5)).unwrap();
        ledger.compact().unwrap();
        ledger.append(&entries(5..9)).unwrap();
    }
    assert_eq!(ledger.len(), 0);
    ledger.append(&entry(9)).unwrap();
    ledger.compact().unwrap();
    drop((ledger, late));
    assert_eq!(open(&place.store()).len(), 10);
}

fn lock(store: &Store) -> Lock {
    let bytes = to_parquet_bytes(&entry(1)).unwrap();
    let published = store.publish("tables/entries/entries.parquet", &bytes).unwrap();
    let output = Output { rows: Some(2), ..published };
    let settings = BTreeMap::from([("design.points".to_owned(), "27".to_owned()), ("study.seed".into(), "1".into())]);
    let stage = StageLock {
        key: key(1),
        version: 2,
        settings,
        inputs: BTreeMap::from([("samples".to_owned(), key(2))]),
        outputs: BTreeMap::from([("tables/entries/entries.parquet".to_owned(), output)]),
    };
    Lock { stages: BTreeMap::from([("aggregate".to_owned(), stage)]) }
}

#[test]
fn a_lock_comes_back_as_it_was_written() {
    let place = Place::new();
    let lock = lock(&place.store());
    let path = place.root.join("pipeline.lock");
    assert_eq!(Lock::read(&path).unwrap(), Lock::default());
    lock.write(&path).unwrap();
    assert_eq!(Lock::read(&path).unwrap(), lock);
    let text = fs::read_to_string(&path).unwrap();
    assert_eq!(text, lock.to_text().unwrap());
    assert!(
        text.contains("[stage.aggregate.settings]\n\"design.points\" = \"27\"\n\"study.seed\" = \"1\"\n"),
        "{text}"
    );

    let now = BTreeMap::from([("design.points".to_owned(), "30".to_owned()), ("study.seed".into(), "1".into())]);
    let changes = lock.stages["aggregate"].changes(&now);
    assert_eq!(changes.len(), 1);
    assert_eq!((changes[0].old.as_deref(), changes[0].new.as_deref()), (Some("27"), Some("30")));
}

#[test]
fn a_lock_that_cannot_be_understood_says_where_and_what_to_do() {
    let place = Place::new();
    let good = lock(&place.store()).to_text().unwrap();
    let path = place.root.join("pipeline.lock");
    let cases = [
        (good.replace("version = 1\n", "version = 9\n"), "lock version 9, this program reads 1"),
        (good[..good.len() - 20].to_owned(), "line"),
        (good.replace("rows = 2", "raws = 2"), "raws"),
        (good.replace(&key(1).to_string(), "abc"), "`abc` is not a digest"),
        ("not a lock".to_owned(), "line 1"),
        (String::new(), "version"),
    ];
    for (text, wanted) in cases {
        fs::write(&path, &text).unwrap();
        let error = Lock::read(&path).unwrap_err().to_string();
        assert!(error.contains(wanted) && error.contains("pipeline.lock") && error.contains("remove it"), "{error}");
    }
    fs::write(&path, [0xff, 0xfe]).unwrap();
    assert!(matches!(Lock::read(&path), Err(StoreError::BadLock { .. })));
    assert!(Lock::read(&place.root).is_err(), "a folder is no lock");
}

#[test]
fn outputs_are_known_by_name_and_size() {
    let place = Place::new();
    let store = place.store();
    let lock = lock(&store);
    let (_, path, output) = lock.outputs().next().unwrap();
    assert!(store.has_output(path, output));
    truncate(&store.root().join(path));
    assert!(!store.has_output(path, output));
    fs::remove_file(store.root().join(path)).unwrap();
    assert!(!store.has_output(path, output));
}

/// A store with a table, an object, a part and a journal file.
fn furnished(place: &Place) -> (Lock, Digest) {
    let store = place.store();
    let lock = lock(&store);
    let state = to_parquet_bytes(&entries(0..100)).unwrap();
    let digest = store.put_object(&state).unwrap();
    let ledger = open(&store);
    ledger.append(&entries(0..4)).unwrap();
    ledger.compact().unwrap();
    ledger.append(&entry(4)).unwrap();
    (lock, digest)
}

#[test]
fn fsck_finds_every_damage_and_sets_it_aside() {
    let place = Place::new();
    let (lock, object) = furnished(&place);
    let needed = BTreeSet::from([object]);
    let examine = |depth, aside| fsck::examine(&place.store(), &lock, &needed, depth, aside).unwrap();
    for depth in [Depth::Fast, Depth::Full] {
        let report = examine(depth, false);
        assert_eq!((report.files, report.findings), (4, vec![]));
    }
    let whole = place.snapshot();
    for path in whole.keys().filter(|path| path.extension().is_some_and(|e| e == "parquet")) {
        flip_a_bit(path);
        let full = examine(Depth::Full, false);
        assert_eq!(full.findings.len(), 1, "{path:?}");
        assert_eq!(&full.findings[0].path, path);
        assert!(matches!(full.findings[0].problem, Problem::WrongDigest { .. }));
        truncate(path);
        let fast = examine(Depth::Fast, true);
        assert_eq!(fast.findings.len(), 1, "{path:?}");
        assert!(matches!(fast.findings[0].problem, Problem::WrongSize { .. } | Problem::Unreadable { .. }));
        assert!(!path.exists() && fast.findings[0].set_aside.as_ref().unwrap().exists());
        let text = fast.findings[0].to_string();
        assert!(text.contains("needed by") && text.contains("moved to"), "{text}");
        place.restore(&whole);
    }
    fs::remove_file(place.store().object_path(&object)).unwrap();
    let report = examine(Depth::Fast, true);
    assert_eq!((report.findings.len(), &report.findings[0].problem), (1, &Problem::Missing));
    place.restore(&whole);
    truncate(&place.ledger_folder().join("manifest.json"));
    let report = examine(Depth::Fast, true);
    assert!(matches!(report.findings[0].problem, Problem::BadManifest { .. }));
    assert_eq!(open(&place.store()).len(), 5, "the parts speak for themselves");
}

#[test]
fn gc_lists_what_nothing_needs_and_deletes_only_that() {
    let place = Place::new();
    let (_, object) = furnished(&place);
    let store = place.store();
    let whole = place.snapshot();
    assert_eq!(gc::find(&store, &BTreeSet::from([object])).unwrap(), []);

    let loose = store.put_object(b"nobody wants this").unwrap();
    fs::write(place.root.join("tables/entries/.tmp-1-2"), b"half").unwrap();
    fs::create_dir_all(place.root.join("quarantine")).unwrap();
    fs::write(place.root.join("quarantine/damaged"), b"damaged").unwrap();
    let old_part = place.ledger_folder().join(format!("part-{}.parquet", key(8)));
    fs::write(&old_part, b"folded").unwrap();

    let garbage = gc::find(&store, &BTreeSet::from([object])).unwrap();
    let kinds: Vec<_> = garbage.iter().map(|file| (file.kind, file.bytes)).collect();
    assert_eq!(kinds, [(Kind::Object, 17), (Kind::Ledger, 6), (Kind::Temporary, 4), (Kind::Quarantine, 7)]);
    assert_eq!(garbage[0].path, store.object_path(&loose));
    assert_eq!(gc::find(&store, &BTreeSet::new()).unwrap().len(), 5, "without roots every object is garbage");
    assert!(matches!(gc::delete(&place.store(), &garbage), Err(StoreError::Busy { .. })));
    assert_eq!(gc::delete(&store, &garbage).unwrap(), 34);
    assert_eq!(place.snapshot(), whole);
}
