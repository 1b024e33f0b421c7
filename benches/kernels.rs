//! The kernels without Python, on one thread, and whole batches on one and two: `cargo bench`, or
//! `cargo bench -- NAME` for some of them.

use _core::batch::{SampleConfig, Slot, Watch, batch, sample};
use _core::buffers::{Buffers, fill_frustum};
use _core::camera::{Camera, DISTANCE, IMAGE, VIEWPOINTS};
use _core::carve::{carve, silhouette};
use _core::csg::Shape;
use _core::evidence::{FIELDS, fill_fields, gather};
use _core::grammar::GrammarConfig;
use _core::lines::{LineConfig, detect};
use _core::random::Random;
use _core::resample::{to_camera_grid, to_world_grid};
use _core::voxel::{BitGrid, CELLS, SIDE};
use criterion::{BenchmarkGroup, Criterion, measurement::WallTime};
use rayon::ThreadPool;
use std::hint::black_box;

type Group<'a> = BenchmarkGroup<'a, WallTime>;

/// The arrays of a batch with one view a sample.
struct Arrays {
    drawings: Vec<u8>,
    worlds: Vec<u8>,
    frusta: Vec<u8>,
}

impl Arrays {
    fn new(count: usize) -> Self {
        let [drawings, worlds, frusta] = [IMAGE * IMAGE, CELLS, CELLS].map(|each| vec![0; count * each]);
        Self { drawings, worlds, frusta }
    }

    fn slots(&mut self) -> Vec<Slot<'_>> {
        let drawings = self.drawings.chunks_exact_mut(IMAGE * IMAGE);
        let grids = self.worlds.chunks_exact_mut(CELLS).zip(self.frusta.chunks_exact_mut(CELLS));
        drawings.zip(grids).map(|(drawings, (world, frusta))| Slot { drawings, world, frusta }).collect()
    }
}

fn main() {
    // Kernels that would take every thread take this one.
    pool(1).install(|| {
        let mut criterion = Criterion::default().configure_from_args();
        let (shape, _) = GrammarConfig::default().draw(&mut Random::new(0, 0, 0)).unwrap();
        let views = VIEWPOINTS.map(|(azimuth, elevation)| Camera::orbit(azimuth, elevation, 0.0, DISTANCE));
        let mut group = criterion.benchmark_group("kernels");
        shapes(&mut group, &shape, &views[0]);
        volumes(&mut group, &shape, &views[0]);
        drawings(&mut group, &shape, &views[..6]);
        samples(&mut group);
    });
    let mut criterion = Criterion::default().configure_from_args();
    batches(&mut criterion.benchmark_group("batch of 64"));
    criterion.final_summary();
}

fn pool(threads: usize) -> ThreadPool {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap()
}

fn shapes(group: &mut Group, shape: &Shape, camera: &Camera) {
    group.bench_function("grammar", |b| {
        let mut index = 0;
        b.iter(|| {
            index += 1;
            GrammarConfig::default().draw(&mut Random::new(0, index, 0))
        });
    });
    let mut bytes = vec![0; CELLS];
    group.bench_function("voxels as bits", |b| b.iter(|| BitGrid::of_shape(black_box(shape))));
    group
        .bench_function("voxels", |b| b.iter(|| BitGrid::of_shape(black_box(shape)).write_bytes(&mut bytes)));
    group.bench_function("depth and normals", |b| b.iter(|| Buffers::of_shape(shape, camera, IMAGE)));
    let seen = Buffers::of_shape(shape, camera, IMAGE).unwrap();
    let mut drawing = vec![0; IMAGE * IMAGE];
    let config = LineConfig::default();
    group.bench_function("lines", |b| b.iter(|| detect(black_box(&seen), &config, &mut drawing)));
    group.bench_function("draw", |b| b.iter(|| _core::lines::draw(shape, camera, &config, &mut drawing)));
    let rays = SampleConfig::default().frustum_rays;
    group.bench_function("frustum", |b| b.iter(|| fill_frustum(shape, camera, rays, &mut bytes)));
}

fn volumes(group: &mut Group, shape: &Shape, camera: &Camera) {
    let mut bytes = vec![0; CELLS];
    BitGrid::of_shape(shape).write_bytes(&mut bytes);
    let world: Vec<f32> = bytes.iter().map(|&b| f32::from(b)).collect();
    let (mut seen, mut back) = (vec![0.0; CELLS], vec![0.0; CELLS]);
    let camera = [*camera];
    group.bench_function("to_camera_grid", |b| b.iter(|| to_camera_grid::<SIDE>(&world, &camera, &mut seen)));
    group.bench_function("to_world_grid", |b| b.iter(|| to_world_grid::<SIDE>(&seen, &camera, &mut back)));
}

fn drawings(group: &mut Group, shape: &Shape, cameras: &[Camera]) {
    let (mut drawings, mut fields) = (vec![0; 6 * IMAGE * IMAGE], vec![0; 6 * FIELDS]);
    for (drawing, camera) in drawings.chunks_exact_mut(IMAGE * IMAGE).zip(cameras) {
        _core::lines::draw(shape, camera, &LineConfig::default(), drawing).unwrap();
    }
    let first = &drawings[..IMAGE * IMAGE];
    group.bench_function("silhouette", |b| b.iter(|| silhouette(black_box(first))));
    let inside: Vec<_> = drawings.chunks_exact(IMAGE * IMAGE).map(silhouette).collect();
    let mut world = vec![0; CELLS];
    group.bench_function("carve by 6", |b| b.iter(|| carve(black_box(&inside), cameras, &mut world)));
    let mut field = vec![0; FIELDS];
    group.bench_function("evidence fields", |b| b.iter(|| fill_fields(black_box(first), &mut field)));
    for (drawing, field) in drawings.chunks_exact(IMAGE * IMAGE).zip(fields.chunks_exact_mut(FIELDS)) {
        fill_fields(drawing, field);
    }
    let mut evidence = vec![0; 3 * CELLS / 2];
    group.bench_function("evidence of 6", |b| b.iter(|| gather(black_box(&fields), cameras, &mut evidence)));
}

fn samples(group: &mut Group) {
    let (config, mut arrays) = (SampleConfig::default(), Arrays::new(1));
    // One after the other through the same 64 as the batch.
    group.bench_function("sample", |b| {
        let mut index = 0;
        b.iter(|| {
            index += 1;
            sample(&config, 0, index % 64, None, arrays.slots().remove(0))
        });
    });
}

fn batches(group: &mut Group) {
    let (config, mut arrays) = (SampleConfig::default(), Arrays::new(64));
    group.sample_size(10);
    for threads in [1, 2] {
        let pool = pool(threads);
        group.bench_function(format!("{threads} threads"), |b| {
            b.iter(|| {
                pool.install(|| batch(&config, 0, 0, None, arrays.slots(), &Watch::default())).unwrap()
            });
        });
    }
}
