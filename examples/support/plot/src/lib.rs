//! Pages of line plots in SVG: panels with a title, a legend above the frame, and curves clipped to the frame.

use plotters::coord::Shift;
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
pub use plotters::style::RGBColor;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::error::Error;
use std::ops::Range;

pub const DARK: RGBColor = RGBColor(0x22, 0x22, 0x22);
pub const BLUE: RGBColor = RGBColor(0x00, 0x72, 0xb2);
pub const VERMILION: RGBColor = RGBColor(0xd5, 0x5e, 0x00);
pub const GREEN: RGBColor = RGBColor(0x00, 0x9e, 0x73);
pub const ORANGE: RGBColor = RGBColor(0xe6, 0x9f, 0x00);
pub const SKY: RGBColor = RGBColor(0x56, 0xb4, 0xe9);
pub const PURPLE: RGBColor = RGBColor(0xcc, 0x79, 0xa7);
pub const GRAY: RGBColor = RGBColor(0x80, 0x80, 0x80);
const FRAME: RGBColor = RGBColor(0x90, 0x90, 0x90);
const GRID: RGBColor = RGBColor(0xe6, 0xe6, 0xe6);

/// The SVG backend rounds to whole units: pages are drawn in quarters of a pixel. All lengths below are in these units.
const UNITS: u32 = 4;
const MARGIN: i32 = 48;
const PAGE_TITLE: i32 = 92;
const PAGE_SUBTITLE: i32 = 92;
const PANEL_TITLE: i32 = 80;
const LEGEND: i32 = 96;
const LEGEND_LINE: i32 = 88;
const KEY_LINE: i32 = 72;
const Y_LABELS: i32 = 240;
const X_LABELS: i32 = 176;
const TICK: i32 = 16;
/// Width to allow for a character of the widest common sans-serif font.
const CHARACTER: i32 = 31;

/// Of the filling of marks.
const OPACITY: f64 = 0.45;

/// Font sizes; plotters' are 1.24 times those of the SVG it writes.
const TEXT: f64 = 1.24 * 52.0;
const TITLE: f64 = 1.24 * 60.0;

type Canvas<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Chart<'a> = ChartContext<'a, SVGBackend<'a>, Cartesian2d<Axis, Axis>>;
type Point = (f64, f64);

/// How the numbers of an axis are written.
#[derive(Clone, Copy)]
pub enum Scale {
    Linear,
    /// Values are decimal logarithms, labels are the numbers themselves.
    Logarithmic,
}

/// Label, range and ticks of an axis.
#[derive(Clone)]
pub struct Axis {
    pub label: &'static str,
    pub range: Range<f64>,
    pub ticks: Vec<f64>,
    pub scale: Scale,
}

impl Axis {
    /// Between two numbers, with these ticks.
    pub fn linear(label: &'static str, range: Range<f64>, ticks: &[f64]) -> Self {
        Self { label, range, ticks: ticks.to_vec(), scale: Scale::Linear }
    }

    /// Between two powers of ten, with a tick at each `every` of them. Points must be given by their logarithms.
    pub fn decades(label: &'static str, from: i32, to: i32, every: usize) -> Self {
        let ticks = (from..=to).step_by(every).map(f64::from).collect();
        Self { label, range: f64::from(from)..f64::from(to), ticks, scale: Scale::Logarithmic }
    }

    /// Zero in the middle, wide enough for the curves.
    pub fn symmetric(label: &'static str, curves: &[Curve]) -> Self {
        let limit = round_up(curves.iter().flat_map(Curve::values).map(f64::abs).fold(0.0, f64::max));
        Self::linear(label, -limit..limit, &[-1.0, -0.5, 0.0, 0.5, 1.0].map(|x| x * limit))
    }

    /// From zero to above the curves.
    pub fn upward(label: &'static str, curves: &[Curve]) -> Self {
        let limit = round_up(curves.iter().flat_map(Curve::values).fold(0.0, f64::max));
        Self::linear(label, -0.04 * limit..limit, &[0.0, 0.25, 0.5, 0.75, 1.0].map(|x| x * limit))
    }
}

/// The next number whose quarters read well.
fn round_up(value: f64) -> f64 {
    let decades = (0..12).map(|k| 10.0_f64.powi(k));
    let mut candidates = decades.flat_map(|decade| [1.0, 2.0, 4.0, 6.0, 8.0].map(|m| m * decade));
    candidates.find(|&candidate| candidate >= value).unwrap_or(value)
}

impl Ranged for Axis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        RangedCoordf64::from(self.range.clone()).map(value, limit)
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.ticks.clone()
    }

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }
}

/// A polyline; without a label it is left out of the legend.
pub struct Curve {
    pub label: Option<String>,
    pub color: RGBColor,
    /// Stroke width in quarters of a pixel.
    pub width: u32,
    pub points: Vec<Point>,
}

impl Curve {
    pub fn values(&self) -> impl Iterator<Item = f64> {
        self.points.iter().map(|point| point.1)
    }
}

/// Curves in a frame, the first one lowest.
pub struct Panel {
    pub title: String,
    pub x: Axis,
    pub y: Axis,
    pub curves: Vec<Curve>,
    /// A remark inside the frame, to the left of and below a point.
    pub note: Option<(Point, String)>,
}

/// A page of 2 × 2 panels under a title and a subtitle, as SVG.
pub fn page(title: &str, subtitle: &str, panels: &[Panel; 4]) -> Result<String, Box<dyn Error>> {
    titled((1000, 860), title, subtitle, panels, (2, 2))
}

/// Two panels beside each other under a title and a subtitle, as SVG.
pub fn pair(title: &str, subtitle: &str, panels: &[Panel; 2]) -> Result<String, Box<dyn Error>> {
    titled((1000, 453), title, subtitle, panels, (1, 2))
}

/// Rows and columns of panels.
fn titled(
    size: (u32, u32),
    title: &str,
    subtitle: &str,
    panels: &[Panel],
    grid: (usize, usize),
) -> Result<String, Box<dyn Error>> {
    svg(size, |canvas| {
        let (head, body) = canvas.split_vertically(PAGE_TITLE + PAGE_SUBTITLE);
        let bold = FontDesc::new(FontFamily::SansSerif, TITLE, FontStyle::Bold);
        head.draw_text(title, &anchored(bold, HPos::Left, VPos::Bottom), (MARGIN, PAGE_TITLE))?;
        let below = (MARGIN, PAGE_TITLE + PAGE_SUBTITLE / 2);
        head.draw_text(subtitle, &text(HPos::Left, VPos::Center), below)?;
        for (panel, area) in panels.iter().zip(body.split_evenly(grid)) {
            draw(panel, &area)?;
        }
        Ok(())
    })
}

/// One wide panel, as SVG.
pub fn banner(panel: &Panel) -> Result<String, Box<dyn Error>> {
    svg((900, 420), |canvas| draw(panel, canvas))
}

/// Draws on a white page of `size` pixels.
fn svg(
    size: (u32, u32),
    content: impl FnOnce(&Canvas<'_>) -> Result<(), Box<dyn Error>>,
) -> Result<String, Box<dyn Error>> {
    let (width, height) = (size.0 * UNITS, size.1 * UNITS);
    let mut svg = String::new();
    {
        let canvas = SVGBackend::with_string(&mut svg, (width, height)).into_drawing_area();
        canvas.fill(&WHITE)?;
        content(&canvas)?;
        canvas.present()?;
    }
    let drawn = format!(r#"width="{width}" height="{height}""#);
    let shown = format!(r#"width="{}" height="{}""#, size.0, size.1);
    Ok(svg.replacen(&drawn, &shown, 1))
}

fn draw(panel: &Panel, area: &Canvas<'_>) -> Result<(), Box<dyn Error>> {
    let (head, rest) = area.margin(MARGIN, MARGIN, MARGIN, MARGIN).split_vertically(PANEL_TITLE);
    head.draw_text(&panel.title, &text(HPos::Left, VPos::Center), (Y_LABELS, PANEL_TITLE / 3))?;
    let width = i32::try_from(rest.dim_in_pixel().0)? - Y_LABELS;
    let lines = legend(&panel.curves, width);
    let (above, body) = rest.split_vertically(LEGEND * i32::try_from(lines.len().max(1))?);
    draw_legend(&lines, &above)?;

    let mut chart = framed(&panel.x, &panel.y, &body)?;
    for curve in &panel.curves {
        for piece in clipped(&curve.points, &panel.x.range, &panel.y.range) {
            chart.draw_series(LineSeries::new(piece, curve.color.stroke_width(curve.width)))?;
        }
    }
    if let Some((point, note)) = &panel.note {
        chart.plotting_area().draw(&Text::new(note.as_str(), *point, text(HPos::Right, VPos::Top)))?;
    }
    Ok(())
}

/// Axes, frame and grid.
fn framed<'a>(x: &Axis, y: &Axis, area: &Canvas<'a>) -> Result<Chart<'a>, Box<dyn Error>> {
    let mut chart = ChartBuilder::on(area)
        .y_label_area_size(Y_LABELS)
        .x_label_area_size(X_LABELS)
        .margin_right(MARGIN)
        .build_cartesian_2d(x.clone(), y.clone())?;
    chart
        .configure_mesh()
        .bold_line_style(GRID.stroke_width(UNITS))
        .light_line_style(TRANSPARENT)
        .axis_style(FRAME.stroke_width(UNITS))
        .set_all_tick_mark_size(TICK)
        .label_style(text(HPos::Left, VPos::Center))
        .x_label_formatter(&|&value| tick_label(value, x.scale))
        .y_label_formatter(&|&value| tick_label(value, y.scale))
        .x_desc(x.label)
        .y_desc(y.label)
        .draw()?;
    Ok(chart)
}

/// A point of a scatter plot.
pub struct Mark {
    pub at: Point,
    /// In pixels.
    pub radius: f64,
    /// Text beside it.
    pub label: Option<String>,
}

/// Points of one kind.
pub struct Cloud {
    pub label: &'static str,
    pub color: RGBColor,
    pub marks: Vec<Mark>,
}

/// What the labels of marks stand for, line by line, to the right of and below a point of the frame.
pub struct Key {
    pub at: Point,
    pub lines: Vec<String>,
}

/// One page of points in a frame, the first cloud lowest; points beyond the frame are drawn on its edge.
pub fn scatter(title: &str, x: &Axis, y: &Axis, clouds: &[Cloud], key: &Key) -> Result<String, Box<dyn Error>> {
    svg((900, 640), |canvas| {
        let inner = canvas.margin(MARGIN, MARGIN, MARGIN, MARGIN);
        let (head, rest) = inner.split_vertically(PANEL_TITLE + LEGEND);
        head.draw_text(title, &text(HPos::Left, VPos::Center), (Y_LABELS, PANEL_TITLE / 3))?;
        let mut left = Y_LABELS;
        for Cloud { label, color, .. } in clouds {
            let middle = PANEL_TITLE + LEGEND / 3;
            head.draw(&Circle::new((left + 2 * CHARACTER / 3, middle), 20, color.mix(OPACITY).filled()))?;
            head.draw_text(label, &text(HPos::Left, VPos::Center), (left + 2 * CHARACTER, middle))?;
            left += i32::try_from(label.chars().count())? * CHARACTER + 3 * CHARACTER;
        }
        let chart = framed(x, y, &rest)?;
        let area = chart.plotting_area();
        let inside = |(px, py): Point| (px.clamp(x.range.start, x.range.end), py.clamp(y.range.start, y.range.end));
        for Cloud { color, marks, .. } in clouds {
            for Mark { at, radius, .. } in marks {
                let size = (radius * f64::from(UNITS)).round() as i32;
                let circle = |style: ShapeStyle| Circle::new(inside(*at), size, style);
                area.draw(&circle(color.mix(OPACITY).filled()))?;
                area.draw(&circle(color.stroke_width(UNITS)))?;
            }
        }
        let labeled = clouds.iter().flat_map(|cloud| &cloud.marks);
        let labeled: Vec<_> = labeled
            .filter_map(|mark| Some((area.map_coordinate(&inside(mark.at)), mark, mark.label.as_ref()?)))
            .collect();
        let (left, top) = rest.get_base_pixel();
        for &((px, py), mark, label) in &labeled {
            let shift = (3.0 * mark.radius + 6.0).round() as i32;
            // Above to the right, or below to the left where another label would be in the way.
            let in_the_way =
                |(x, y): (i32, i32)| (1..3 * CHARACTER).contains(&(x - px)) && (y - py).abs() < 3 * CHARACTER;
            match labeled.iter().any(|other| in_the_way(other.0)) {
                true => rest.draw_text(label, &text(HPos::Right, VPos::Top), (px - left - shift, py - top + shift))?,
                false => {
                    rest.draw_text(label, &text(HPos::Left, VPos::Bottom), (px - left + shift, py - top - shift))?
                }
            }
        }
        let (px, py) = area.map_coordinate(&key.at);
        for (line, below) in key.lines.iter().zip(0..) {
            rest.draw_text(line, &text(HPos::Left, VPos::Top), (px - left, py - top + KEY_LINE * below))?;
        }
        Ok(())
    })
}

/// The labeled curves, broken into lines of a width.
fn legend(curves: &[Curve], width: i32) -> Vec<Vec<(i32, &Curve, &str)>> {
    let mut lines: Vec<Vec<(i32, &Curve, &str)>> = Vec::new();
    let mut x = width;
    for curve in curves {
        let Some(label) = &curve.label else { continue };
        let length = LEGEND_LINE + label.chars().map(|_| CHARACTER).sum::<i32>() + 3 * CHARACTER;
        if x + length > width {
            x = 0;
            lines.push(Vec::new());
        }
        if let Some(line) = lines.last_mut() {
            line.push((x, curve, label));
        }
        x += length;
    }
    lines
}

/// A sample of each labeled curve.
fn draw_legend(lines: &[Vec<(i32, &Curve, &str)>], area: &Canvas<'_>) -> Result<(), Box<dyn Error>> {
    for (y, line) in (0..).map(|line| LEGEND / 3 + LEGEND * line).zip(lines) {
        for &(x, curve, label) in line {
            let x = Y_LABELS + x;
            let sample = vec![(x, y), (x + LEGEND_LINE, y)];
            area.draw(&PathElement::new(sample, curve.color.stroke_width(curve.width)))?;
            area.draw_text(label, &text(HPos::Left, VPos::Center), (x + LEGEND_LINE + CHARACTER, y))?;
        }
    }
    Ok(())
}

fn text(horizontal: HPos, vertical: VPos) -> TextStyle<'static> {
    anchored(FontDesc::new(FontFamily::SansSerif, TEXT, FontStyle::Normal), horizontal, vertical)
}

fn anchored(font: FontDesc<'static>, horizontal: HPos, vertical: VPos) -> TextStyle<'static> {
    TextStyle::from(font).color(&DARK).pos(Pos::new(horizontal, vertical))
}

/// As few digits as possible, with a minus sign rather than a hyphen.
fn tick_label(value: f64, scale: Scale) -> String {
    let text = match scale {
        Scale::Linear => ((value * 1e6).round() / 1e6).to_string(),
        Scale::Logarithmic if (-2.5..4.5).contains(&value) => 10.0_f64.powf(value).to_string(),
        Scale::Logarithmic => format!("1e{value}"),
    };
    text.replace('-', "−")
}

/// The pieces of a polyline inside a rectangle.
fn clipped(points: &[Point], x: &Range<f64>, y: &Range<f64>) -> Vec<Vec<Point>> {
    let mut pieces: Vec<Vec<Point>> = Vec::new();
    for segment in points.windows(2) {
        let Some((from, to)) = clipped_segment(segment[0], segment[1], x, y) else { continue };
        match pieces.last_mut() {
            Some(piece) if piece.last() == Some(&from) => piece.push(to),
            _ => pieces.push(vec![from, to]),
        }
    }
    pieces
}

/// The part of a segment inside a rectangle (Liang and Barsky).
fn clipped_segment(from: Point, to: Point, x: &Range<f64>, y: &Range<f64>) -> Option<(Point, Point)> {
    let span = (to.0 - from.0, to.1 - from.1);
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for (start, span, range) in [(from.0, span.0, x), (from.1, span.1, y)] {
        if span == 0.0 {
            if start < range.start || start > range.end {
                return None;
            }
            continue;
        }
        let (a, b) = ((range.start - start) / span, (range.end - start) / span);
        (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
    }
    let at = |fraction: f64| (from.0 + fraction * span.0, from.1 + fraction * span.1);
    (enter < leave).then(|| (at(enter), if leave < 1.0 { at(leave) } else { to }))
}
