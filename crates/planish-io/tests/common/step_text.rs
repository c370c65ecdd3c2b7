//! The text of STEP files with elementary faces, as other programs write them.

/// A file that grows.
#[derive(Default)]
pub struct File {
    pub lines: Vec<String>,
    pub faces: Vec<usize>,
}

impl File {
    pub fn add(&mut self, entity: String) -> usize {
        self.lines.push(format!("#{}={entity};", self.lines.len() + 1));
        self.lines.len()
    }

    pub fn point(&mut self, [x, y, z]: [f64; 3]) -> usize {
        self.add(format!("CARTESIAN_POINT('',({x:?},{y:?},{z:?}))"))
    }

    pub fn direction(&mut self, [x, y, z]: [f64; 3]) -> usize {
        self.add(format!("DIRECTION('',({x:?},{y:?},{z:?}))"))
    }

    /// Axes parallel to those of the file.
    pub fn frame(&mut self, origin: [f64; 3]) -> usize {
        let (o, z, x) = (self.point(origin), self.direction([0.0, 0.0, 1.0]), self.direction([1.0, 0.0, 0.0]));
        self.add(format!("AXIS2_PLACEMENT_3D('',#{o},#{z},#{x})"))
    }

    pub fn vertex(&mut self, at: [f64; 3]) -> usize {
        let p = self.point(at);
        self.add(format!("VERTEX_POINT('',#{p})"))
    }

    /// A circle around the z axis that begins and ends at one vertex.
    pub fn circle(&mut self, height: f64, radius: f64, vertex: usize) -> usize {
        let frame = self.frame([0.0, 0.0, height]);
        let circle = self.add(format!("CIRCLE('',#{frame},{radius:?})"));
        self.add(format!("EDGE_CURVE('',#{vertex},#{vertex},#{circle},.T.)"))
    }

    pub fn line(&mut self, ends: [usize; 2], [from, along]: [[f64; 3]; 2]) -> usize {
        let (p, d) = (self.point(from), self.direction(along));
        let v = self.add(format!("VECTOR('',#{d},1.)"));
        let line = self.add(format!("LINE('',#{p},#{v})"));
        self.add(format!("EDGE_CURVE('',#{},#{},#{line},.T.)", ends[0], ends[1]))
    }

    /// A bound of edges, each forwards or backwards.
    pub fn bound(&mut self, edges: &[(usize, bool)]) -> usize {
        let word = |is: bool| if is { ".T." } else { ".F." };
        let edges: Vec<String> = edges
            .iter()
            .map(|&(edge, forward)| {
                format!("#{}", self.add(format!("ORIENTED_EDGE('',*,*,#{edge},{})", word(forward))))
            })
            .collect();
        let ring = self.add(format!("EDGE_LOOP('',({}))", edges.join(",")));
        self.add(format!("FACE_BOUND('',#{ring},.T.)"))
    }

    pub fn point_bound(&mut self, vertex: usize) -> usize {
        let ring = self.add(format!("VERTEX_LOOP('',#{vertex})"));
        self.add(format!("FACE_BOUND('',#{ring},.T.)"))
    }

    pub fn face(&mut self, bounds: &[usize], surface: usize, outward: bool) {
        let bounds: Vec<String> = bounds.iter().map(|b| format!("#{b}")).collect();
        let word = if outward { ".T." } else { ".F." };
        let face = self.add(format!("ADVANCED_FACE('',({}),#{surface},{word})", bounds.join(",")));
        self.faces.push(face);
    }

    /// The text of all faces as one shell.
    pub fn text(&mut self) -> String {
        let faces: Vec<String> = self.faces.iter().map(|f| format!("#{f}")).collect();
        let shell = self.add(format!("CLOSED_SHELL('',({}))", faces.join(",")));
        let solid = self.add(format!("MANIFOLD_SOLID_BREP('',#{shell})"));
        self.add(format!("ADVANCED_BREP_SHAPE_REPRESENTATION('',(#{solid}),$)"));
        wrapped(&self.lines.join("\n"))
    }
}

pub fn wrapped(data: &str) -> String {
    format!("ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\n{data}\nENDSEC;\nEND-ISO-10303-21;\n")
}

/// A can of radius 1 and height 2, its side cut open along a seam or bounded by two circles.
pub fn can(has_seam: bool) -> File {
    let mut file = File::default();
    let (low, high) = (file.vertex([1.0, 0.0, 0.0]), file.vertex([1.0, 0.0, 2.0]));
    let (bottom, top) = (file.circle(0.0, 1.0, low), file.circle(2.0, 1.0, high));
    let seam = file.line([low, high], [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
    let frame = file.frame([0.0; 3]);
    let side = file.add(format!("CYLINDRICAL_SURFACE('',#{frame},1.)"));
    let bounds = if has_seam {
        vec![file.bound(&[(bottom, true), (seam, true), (top, false), (seam, false)])]
    } else {
        vec![file.bound(&[(bottom, true)]), file.bound(&[(top, false)])]
    };
    file.face(&bounds, side, true);
    for (height, circle, up) in [(0.0, bottom, false), (2.0, top, true)] {
        let frame = file.frame([0.0, 0.0, height]);
        let plane = file.add(format!("PLANE('',#{frame})"));
        let bound = file.bound(&[(circle, up)]);
        file.face(&[bound], plane, up);
    }
    file
}
